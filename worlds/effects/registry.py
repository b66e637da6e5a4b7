"""All effects by name: classes in the files here, by stage; no list to edit.

Other packages add theirs by the entry point `bns.effects`, in their `pyproject.toml`:

    [project.entry-points."bns.effects"]
    loose_wheel = "my_package.effects:LooseWheel"

An effect is written in text as ``wheel_gain:wheel=left,factor=0.8`` and in TOML as a
table ``{effect = "wheel_gain", wheel = "left", factor = 0.8}``.
"""

import inspect
import pkgutil
from collections.abc import Iterator, Mapping
from functools import cache
from importlib import import_module
from importlib.metadata import EntryPoint, entry_points
from types import ModuleType
from typing import Any

from bns.errors import BnsError, UnknownNameError
from bns.worlds import effects as package
from bns.worlds.effects.base import Effect

GROUP = "bns.effects"
"""entry points of other packages"""
EXAMPLE = "wheel_gain:wheel=left,factor=0.8"
FORMER = {
    "sensor_gain": "reading_gain",
    "sensor_offset": "reading_offset",
    "sensor_delay": "reading_delay",
}
"""Names that effects on a `part` had before; their texts are still read."""


@cache
def _classes() -> dict[str, type[Effect]]:
    found: dict[str, type[Effect]] = {}
    for module in _modules():
        for _, item in inspect.getmembers(module, inspect.isclass):
            if (
                issubclass(item, Effect)
                and hasattr(item, "name")
                and not inspect.isabstract(item)
                and item.__module__ == module.__name__
            ):
                if item.name in found:
                    raise BnsError(f"Two effects are called {item.name!r}; rename one.")
                found[item.name] = item
    for entry in entry_points(group=GROUP):
        found |= _installed(entry, found)
    return dict(sorted(found.items()))


def _installed(
    entry: EntryPoint, known: Mapping[str, type[Effect]]
) -> dict[str, type[Effect]]:
    """The effect that another package adds.

    Raises:
        BnsError: it is no effect, cannot be imported, or its name is taken.
    """
    try:
        item = entry.load()
    except (ImportError, AttributeError) as error:
        raise BnsError(
            f"Effect {entry.name!r} of another package cannot be imported from "
            f"{entry.value} ({error}); mend or uninstall that package."
        ) from error
    if not (inspect.isclass(item) and issubclass(item, Effect)):
        raise BnsError(
            f"{entry.value}, registered as effect {entry.name!r}, is not a subclass of "
            "bns.worlds.effects.base.Effect."
        )
    if item.name != entry.name or item.name in known:
        raise BnsError(
            f"{entry.value} is called {item.name!r}: it has to be {entry.name!r}, as "
            "it is registered, and no other effect's name."
        )
    return {item.name: item}


def _modules() -> Iterator[ModuleType]:
    """All files here, and in the folders here."""
    for info in pkgutil.walk_packages(package.__path__, f"{package.__name__}."):
        yield import_module(info.name)


def names() -> tuple[str, ...]:
    """Names of all effects, sorted."""
    return tuple(_classes())


def get(name: str) -> type[Effect]:
    """The effect class called `name`.

    Raises:
        UnknownNameError: there is none.
    """
    if name not in _classes():
        raise UnknownNameError("effect", name, names())
    return _classes()[name]


def make(name: str, **values: Any) -> Effect:
    """The effect `name` with the given parameter and choice values.

    Raises:
        UnknownNameError: unknown effect, parameter or option.
        OutOfBoundsError: a value outside its bounds.
    """
    return get(current(name) if "part" in values else name)(values)


def current(name: str) -> str:
    """The name of an effect on a part today, if it had another one before."""
    return FORMER.get(name, name)


def parse(text: str) -> Effect:
    """The effect written in `text`, as ``NAME`` or ``NAME:parameter=value,...``.

    A piece without ``=`` belongs to the value before it, so values may hold commas.

    Raises:
        BnsError: bad syntax, or what `make` raises.
    """
    name, colon, rest = text.strip().partition(":")
    values: dict[str, str] = {}
    last = ""
    for piece in rest.split(",") if colon else ():
        key, equals, value = (part.strip() for part in piece.partition("="))
        if equals and key and key not in values:
            values[key] = value
            last = key
        elif last and piece.strip() and not equals:
            values[last] += f",{piece.strip()}"
        else:
            raise BnsError(
                f"Effect {text!r} cannot be read at {piece!r}: write "
                f"NAME:parameter=value,..., each parameter once, as in {EXAMPLE!r}."
            )
    return make(name.strip(), **values)


def from_table(table: Mapping[str, Any]) -> Effect:
    """The effect in a table with the key ``effect`` and its values.

    Raises:
        BnsError: no name in the table, or what `make` raises.
    """
    values = dict(table)
    name = values.pop("effect", None)
    if not isinstance(name, str):
        raise BnsError(
            f"Effect table {dict(table)!r} has no name: give "
            '{effect = "wheel_gain", wheel = "left", factor = 0.8}.'
        )
    return make(name, **values)
