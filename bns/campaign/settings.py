"""Settings by dotted name: from nested tables, into configurations, as short words."""

from collections.abc import Iterable, Mapping
from typing import Any

from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.experiment.loading import from_mapping, nested
from bns.experiment.validate import leaves

OWN = ("preset", "seed", "replicates", "record_replicates", "threads")
"""settings that the campaign decides itself"""


def known() -> dict[str, Any]:
    """Every setting a campaign can vary, with its default."""
    return {name: v for name, v in leaves(RunConfig()) if name not in OWN}


def flatten(content: Mapping[str, Any], where: str) -> dict[str, Any]:
    """Nested or dotted tables as dotted settings.

    Args:
        content: for example ``{"adaptation": {"window": [0, 150]}}``.
        where: the table's name, for messages.

    Raises:
        UnknownNameError: a setting that does not exist.
        BnsError: one that the campaign decides itself.
    """
    return dict(_walk(content, where, "", known()))


def with_settings(base: RunConfig, settings: Mapping[str, Any]) -> RunConfig:
    """A configuration with some settings changed.

    Raises:
        BnsError: a value that is not allowed.
    """
    return from_mapping(nested(settings), base)


def label(settings: Mapping[str, Any]) -> str:
    """Settings in a few words: ``window=150, damage=wheel_gain:...@30``."""
    short = shortened(settings)
    return ", ".join(f"{short[name]}={text(v)}" for name, v in settings.items())


def shortened(names: Iterable[str]) -> dict[str, str]:
    """The last part of each dotted name, the whole name where that is not unique."""
    names = list(names)
    ends = [name.rpartition(".")[2] for name in names]
    return {
        name: end if ends.count(end) == 1 else name
        for name, end in zip(names, ends, strict=True)
    }


def text(value: Any) -> str:
    """A value as a word."""
    if isinstance(value, list | tuple):
        return "+".join(map(text, value)) or "none"
    if isinstance(value, Mapping):
        return str(value.get("effect", "table"))
    if isinstance(value, bool):
        return "yes" if value else "no"
    return f"{value:g}" if isinstance(value, float) else str(value)


def _walk(
    content: Mapping[str, Any], where: str, prefix: str, settings: Mapping[str, Any]
) -> Iterable[tuple[str, Any]]:
    for key, value in content.items():
        name = prefix + key
        if name in OWN:
            raise BnsError(
                f"{where}: {name!r} is not a setting to vary: replicates and seed "
                "stand at the top of the campaign file, the rest follows from them."
            )
        if name in settings:
            yield name, value
        elif name == "settings" and isinstance(value, Mapping):
            # which there are is known once the learner is
            yield from ((f"{name}.{own}", item) for own, item in value.items())
        elif isinstance(value, Mapping) and any(
            s.startswith(f"{name}.") for s in settings
        ):
            yield from _walk(value, where, f"{name}.", settings)
        else:
            raise UnknownNameError(f"setting in {where}", name, settings)
