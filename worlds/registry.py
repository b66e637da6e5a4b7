"""All worlds by name; other packages add theirs by the entry point `bns.worlds`.

A world is registered as a callable that takes settings by keyword and returns a
`World`. An installed package does so in its `pyproject.toml`,

    [project.entry-points."bns.worlds"]
    my-world = "my_package.module:MyWorld"

and a script with `register("my-world", MyWorld)`. The first line of the callable's
docstring is its description. Worlds that a user keeps in `worlds.toml` are found as
well (`bns.worlds.corrected`).
"""

import inspect
from collections.abc import Callable, Iterable, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import Any, get_args

from bns.errors import BnsError, UnknownNameError
from bns.worlds import corrected
from bns.worlds.world import World

GROUP = "bns.worlds"
_BUILT_IN = {
    "hardware": "bns.hardware.worlds.wheeled:HardwareWorld",
    "hexapod": "bns.worlds.physics.legged_world:HexapodWorld",
    "mujoco": "bns.worlds.physics.wheeled_world:MujocoWorld",
    "light": "bns.worlds.light.world:LightWorld",
    "static-snn": "bns.worlds.static_snn:StaticSnnWorld",
}
_registered: dict[str, Callable[..., World]] = {}


def register(name: str, factory: Callable[..., World]) -> None:
    """Make a world known under a name.

    Raises:
        BnsError: the name is taken by another one.
    """
    if name in names() and _registered.get(name) is not factory:
        raise BnsError(f"A world called {name!r} exists already; take another name.")
    _registered[name] = factory


@cache
def _installed() -> dict[str, Any]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def names() -> tuple[str, ...]:
    """Names of all worlds, sorted."""
    return tuple(sorted({*_BUILT_IN, *_installed(), *_registered, *corrected.known()}))


def get(name: str) -> Callable[..., World]:
    """What makes the world called `name`.

    Raises:
        UnknownNameError: there is none.
    """
    if name in _registered:
        return _registered[name]
    if name in _BUILT_IN:
        module, _, attribute = _BUILT_IN[name].partition(":")
        return getattr(import_module(module), attribute)
    if name in _installed():
        return _installed()[name].load()
    kept = corrected.known()
    if name in kept:
        return corrected.factory(kept[name], make)
    if path := corrected.elsewhere(name):
        raise BnsError(
            f"World {name!r} is kept in {path}, which is read in {path.parent} alone: "
            "run there, name the file in $BNS_WORLDS, or keep it for all directories "
            "with `bns gap apply ... --user`."
        )
    also = "A world of `bns gap apply` is known beside its file; --user: everywhere."
    raise UnknownNameError("world", name, names(), also)


def describe() -> dict[str, str]:
    """One line about each world, by name."""
    docs = {name: inspect.getdoc(get(name)) or "" for name in names()}
    return {name: doc.split("\n", 1)[0] for name, doc in docs.items()}


def settings(name: str) -> tuple[str, ...]:
    """Names of the settings that `make` takes for a world.

    Raises:
        UnknownNameError: no such world.
    """
    return tuple(_parameters(name))


def lacking(name: str, wanted: Iterable[str]) -> list[str]:
    """Which of some settings a world does not take.

    Raises:
        UnknownNameError: no such world.
    """
    known = _parameters(name)
    if any(p.kind is p.VAR_KEYWORD for p in known.values()):
        return []
    return [setting for setting in wanted if setting not in known]


def _parameters(name: str) -> Mapping[str, inspect.Parameter]:
    """What a world takes; one that a user keeps takes what its base does."""
    found = get(name)
    while base := getattr(found, "made_of", ""):
        found = get(base)
    known: dict[str, inspect.Parameter] = {}
    for key, item in inspect.signature(found).parameters.items():
        if item.kind is not item.VAR_KEYWORD or not get_args(item.annotation):
            known[key] = item
            continue
        (record,) = get_args(item.annotation)  # Unpack[...]: settings by keyword
        for setting in record.__annotations__:
            known[setting] = item.replace(name=setting, kind=item.KEYWORD_ONLY)
    return known


def make(name: str, /, **settings: Any) -> World:
    """The world called `name`.

    Args:
        name: of the world.
        settings: keyword arguments of the world.

    Raises:
        UnknownNameError: no such world, or it has no such setting.
        BnsError: a setting that the world refuses.
    """
    for setting in lacking(name, settings):
        raise UnknownNameError(f"setting of {name}", setting, _parameters(name))
    return get(name)(**settings)
