"""Configurations from TOML, from JSON and back; unknown keys are errors."""

import json
from collections.abc import Mapping
from dataclasses import asdict, fields, is_dataclass, replace
from pathlib import Path
from typing import Any, Literal, get_args, get_origin, get_type_hints

import tomli_w

from bns.errors import BnsError, UnknownNameError
from bns.experiment.config import LearnerSettings, PriorConfig, RunConfig
from bns.experiment.validate import check
from bns.learners.bns.config import BNS_SECTIONS
from bns.storage import reading

TABLES = ("damage", "reality")
"""settings whose entries may be tables instead of text"""


def from_mapping(
    content: Mapping[str, Any], base: RunConfig | None = None
) -> RunConfig:
    """A configuration with the settings in `content` over those of `base`.

    Raises:
        UnknownNameError: a key that no setting has.
        BnsError: a value of the wrong type, out of bounds, or contradictory.
    """
    base, content = base or RunConfig(), _of_today(content)
    learner = content.get("learner", base.learner)
    if learner != base.learner or not isinstance(base.settings, _settings(learner)):
        base = with_learner(base, learner)
    return check(_merge(base, content, ""))


def with_learner(config: RunConfig, learner: str) -> RunConfig:
    """The same experiment for another learner, whose settings are the usual ones.

    Sections that belong to the learner before, and not to this one, go back to their
    defaults.

    Raises:
        UnknownNameError: no such learner.
    """
    from bns.learners import registry

    kind, usual = _settings(learner), RunConfig()
    fresh: dict[str, Any] = {}
    if learner != config.learner and config.learner in registry.names():
        names = set(_sections(config.learner)) - set(_sections(learner))
        fresh = {name: getattr(usual, name) for name in names}
    return replace(config, learner=learner, settings=kind(), **fresh)


def _sections(learner: str) -> tuple[str, ...]:
    """Sections of a configuration that a learner heeds, beside `settings`."""
    from bns.learners import registry

    return BNS_SECTIONS if learner == "bns" else registry.get(learner).sections


def _settings(learner: Any) -> type[LearnerSettings]:
    """The settings of a learner; those of bns are known without loading it.

    Raises:
        UnknownNameError: no such learner.
    """
    from bns.learners import registry

    if learner == "bns":
        return LearnerSettings
    if not isinstance(learner, str):
        raise BnsError(f"learner = {learner!r} is not allowed: give text.")
    return registry.get(learner).Settings


def nested(flat: Mapping[str, Any]) -> dict[str, Any]:
    """Values by dotted name as a tree of mappings."""
    tree: dict[str, Any] = {}
    for name, value in flat.items():
        *path, leaf = name.split(".")
        place = tree
        for part in path:
            place = place.setdefault(part, {})
        place[leaf] = value
    return tree


def flat(tree: Mapping[str, Any], prefix: str = "") -> dict[str, Any]:
    """A tree of mappings as values by dotted name, the inverse of `nested`."""
    found: dict[str, Any] = {}
    for key, value in tree.items():
        if isinstance(value, Mapping):
            found |= flat(value, f"{prefix}{key}.")
        else:
            found[prefix + key] = value
    return found


OLD_LEARNERS = {"navigation": "", "light": "light", "walk": "walk"}
"""what `learner` was called up to version 0.1, when it said what is learned: task"""


def _of_today(content: Mapping[str, Any]) -> Mapping[str, Any]:
    """Content of version 0.1, in which `learner` was the task, as today's."""
    task = OLD_LEARNERS.get(str(content.get("learner")))
    if task is None:
        return content
    table = content.get("task", {})
    if task and isinstance(table, Mapping):
        table = {**table, "name": task}
    changed = {**content, "learner": "bns"}
    return {**changed, "task": table} if table else changed


def from_file(path: Path | str) -> RunConfig:
    """A configuration from a TOML file.

    The key `preset` at the top names a preset that the file starts from;
    `description` is free text.

    Raises:
        FormatError: not there, or not TOML.
        BnsError: as `from_mapping`.
    """
    return from_document(read_toml(Path(path)))


def from_document(content: Mapping[str, Any]) -> RunConfig:
    """A configuration from the content of a TOML file, see `from_file`.

    Raises:
        BnsError: as `from_mapping`.
    """
    from bns import presets

    content = dict(content)
    content.pop("description", None)
    name = content.pop("preset", "")
    if not isinstance(name, str):
        raise BnsError(f"preset = {name!r} is not allowed: give a preset's name.")
    return from_mapping(content, presets.load(name) if name else None)


def read_toml(path: Path) -> dict[str, Any]:
    """The content of a TOML file.

    Raises:
        FormatError: not there, or not TOML.
    """
    return reading.read_toml(path)


def to_mapping(config: RunConfig) -> dict[str, Any]:
    """The whole configuration as plain values, ready for JSON."""
    content: dict[str, Any] = json.loads(json.dumps(asdict(config)))
    idle = set(BNS_SECTIONS) - set(_sections(config.learner))
    content = {name: value for name, value in content.items() if name not in idle}
    if config.prior == PriorConfig():
        content.pop("prior")
    if not content["settings"]:
        content.pop("settings")
    return content


def to_toml(config: RunConfig) -> str:
    """The whole configuration as TOML; `from_file` reads it back."""
    content = to_mapping(config)
    content.pop("preset")
    return tomli_w.dumps(content)


def differences(one: RunConfig, other: RunConfig) -> dict[str, tuple[Any, Any]]:
    """Settings in which two configurations differ, with both values."""
    from bns.experiment.validate import leaves

    values = dict(leaves(other))
    return {
        key: (value, values[key])
        for key, value in leaves(one)
        if value != values[key] and key != "preset"
    }


def _merge(config: Any, content: Mapping[str, Any], prefix: str) -> Any:
    names = [field.name for field in fields(config)]
    hints = get_type_hints(type(config))
    changes = {}
    for key, given in content.items():
        if key not in names:
            raise UnknownNameError("setting", prefix + key, [prefix + n for n in names])
        current = getattr(config, key)
        if is_dataclass(current):
            if not isinstance(given, Mapping):
                raise BnsError(
                    f"{prefix}{key} = {given!r} is not allowed: it is a table."
                )
            changes[key] = _merge(current, given, f"{prefix}{key}.")
        else:
            changes[key] = _convert(prefix + key, hints[key], given)
    return replace(config, **changes)


def _convert(name: str, kind: Any, given: Any) -> Any:
    if get_origin(kind) is Literal:
        if given not in get_args(kind):
            raise UnknownNameError(name, str(given), get_args(kind))
        return given
    if get_origin(kind) is tuple:
        return _texts(name, given)
    if kind is float and type(given) is int:
        return float(given)
    if type(given) is not kind:
        wanted = {bool: "true or false", int: "a whole number", float: "a number"}
        raise BnsError(
            f"{name} = {given!r} is not allowed: give {wanted.get(kind, 'text')}."
        )
    return given


def _texts(name: str, given: Any) -> tuple[str, ...]:
    entries = [given] if isinstance(given, str) else given
    if not isinstance(entries, list | tuple):
        raise BnsError(f"{name} = {given!r} is not allowed: give a list of texts.")
    texts = []
    for entry in entries:
        if isinstance(entry, Mapping) and name.rpartition(".")[2] in TABLES:
            from bns.worlds.damage import Event

            entry = str(Event.from_table(entry))
        if not isinstance(entry, str):
            raise BnsError(f"{name}: {entry!r} is not allowed: give text.")
        texts.append(entry)
    return tuple(texts)
