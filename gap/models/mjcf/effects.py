"""Effects on parts of any MJCF model: those of the library that have a `part`."""

from collections.abc import Mapping
from typing import Any

from bns.errors import BnsError, UnknownNameError
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.effects.parts import Part


def _kind(effect: type[Effect]) -> str:
    """What an effect acts on: "joint", ..., "channel"; "" = on no part."""
    kinds = [item.kind for item in effect.choices if isinstance(item, Part)]
    return kinds[0] if kinds else ""


CLASSES: Mapping[str, type[Effect]] = {
    name: registry.get(name)
    for name in registry.names()
    if _kind(registry.get(name)) and "own" in registry.get(name).robots
}
"""all of them by name"""

OWNERS = {
    name: _kind(effect)
    for name, effect in CLASSES.items()
    if _kind(effect) != "channel"
}
"""kind of part of the effects on the model; the others act on channels"""


def current(name: str) -> str:
    """The name of an effect or candidate today, if it had another one before."""
    effect, bracket, part = name.partition("[")
    return registry.current(effect) + bracket + part


def make(name: str, values: Mapping[str, Any]) -> Effect:
    """An effect by name.

    Raises:
        UnknownNameError: no such effect or parameter.
        OutOfBoundsError: a value that is not allowed.
    """
    if current(name) not in CLASSES:
        raise UnknownNameError("effect on a model of your own", name, CLASSES)
    return CLASSES[current(name)](values)


def parse(text: str) -> Effect:
    """The effect written as ``joint_damping:part=elbow,added=0.05``.

    Raises:
        BnsError: it can not be read.
    """
    name, _, rest = text.strip().partition(":")
    pairs = [piece.partition("=") for piece in rest.split(",") if piece]
    if not all(equals for _, equals, _ in pairs):
        raise BnsError(
            f"Effect {text!r} cannot be read: write NAME:part=NAME,parameter=value."
        )
    return make(name.strip(), {key.strip(): value.strip() for key, _, value in pairs})
