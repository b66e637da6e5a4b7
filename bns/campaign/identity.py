"""What a configuration is: its settings by dotted name, and the digest of them.

Settings come from nested tables, go into configurations, and are said in short words.

The identity of a configuration, whatever it is called and wherever it stands in a file,
is a digest of the settings in which it differs from the defaults. Replicates, seed,
threads, device, the preset's name, the settings of other tasks and learners and those
of a watch that is not kept are no part of it. A setting that is added later therefore
changes no identity; a default that is changed would leave them equal, so a store keeps
whole configurations and refuses what does not match them.
"""

import json
from collections.abc import Iterable, Iterator, Mapping
from dataclasses import replace
from hashlib import sha256
from typing import Any

from bns import seeding
from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.loading import from_mapping, nested
from bns.experiment.validate import leaves
from bns.learners import registry as learners
from bns.learners.bns.config import BNS_SECTIONS, AdaptationConfig
from bns.tasks import registry as tasks

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


TASK_SECTIONS = ("light", "walk")
"""sections that belong to the tasks of that kind alone"""

NO_PART = {"preset", "seed", "replicates", "record_replicates", "threads", "device"}


def settings(config: RunConfig) -> dict[str, Any]:
    """The settings that tell a configuration from the default one."""
    default = dict(leaves(replace(RunConfig(), settings=type(config.settings)())))
    return {
        name: value
        for name, value in _own(config)
        if name not in NO_PART and value != default[name]
    }


def foreign(config: RunConfig) -> list[str]:
    """Sections of the configuration that belong to other tasks and learners."""
    others = [name for name in TASK_SECTIONS if name != tasks.kind(config.task.name)]
    own = learners.sections(config.learner)
    return others + [name for name in BNS_SECTIONS if name not in own]


def _own(config: RunConfig) -> Iterator[tuple[str, Any]]:
    others, kind = foreign(config), tasks.kind(config.task.name)
    idle = {f"watch.{name}" for name in config.watch.idle(kind)}
    for name, value in leaves(config):
        if name.partition(".")[0] in others or name in idle:
            continue
        if config.learner == "bns" and kind in TASK_SECTIONS:
            # as it was called up to version 0.1: identities stay what they are
            name, value = _named_before(name, value, kind)
        yield name, value


def _named_before(name: str, value: Any, kind: str) -> tuple[str, Any]:
    """A setting of bns as version 0.1 had it, where `learner` said what is learned."""
    if name == "learner":
        return name, kind
    return (name, "simple") if name == "task.name" else (name, value)


def identity(config: RunConfig) -> str:
    """The configuration's name: 12 hexadecimal digits."""
    return digest(settings(config))


def core(config: RunConfig) -> str:
    """The identity without what runs of one batch may differ in."""
    bare = replace(config, adaptation=AdaptationConfig(), world=WorldConfig())
    return digest(settings(bare) | {"device": config.device})


def digest(content: Any, length: int = 12) -> str:
    """A digest of plain values, the same on every machine."""
    text = json.dumps(content, sort_keys=True, separators=(",", ":"))
    return sha256(text.encode()).hexdigest()[:length]


def batch_seed(seed: int, members: Iterable[tuple[str, int]]) -> int:
    """The seed of a batch, from who is in it.

    Args:
        seed: of the campaign.
        members: identity and first replicate of each configuration, sorted.
    """
    names = [part for identity, start in members for part in (identity, start)]
    return seeding.integer(seed, "campaign", *names)


def world_seed(seed: int) -> int:
    """The seed of worlds that are trained: one world for the whole campaign."""
    return seeding.integer(seed, "campaign-world")


def changed_default(wanted: RunConfig, stored: RunConfig) -> str:
    """A setting in which configurations of one identity differ; empty if none."""
    theirs = dict(_own(stored))
    for name, value in _own(wanted):
        if name not in NO_PART and theirs.get(name) != value:
            return f"{name} = {theirs.get(name)!r}, now {value!r}"
    return ""
