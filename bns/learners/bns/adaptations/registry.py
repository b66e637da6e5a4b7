"""Finding adaptations by name and reading them from text."""

import pkgutil
from collections.abc import Callable
from dataclasses import dataclass
from functools import cache
from importlib import import_module
from types import ModuleType

from bns.errors import BnsError, UnknownNameError
from bns.learners.bns import adaptations

PARTS = ("population", "simulator", "data")


@dataclass(frozen=True)
class Extra:
    """An adaptation with its parameters' values."""

    name: str
    parameters: tuple[tuple[str, float], ...]
    function: Callable[..., set[str]]

    def resets(self, trial: int, onset: int) -> set[str]:
        """What a run resets before a trial; see `bns.learners.bns.adaptations`.

        Raises:
            BnsError: the adaptation names something that cannot be reset.
        """
        parts = self.function(trial, onset, **dict(self.parameters))
        for part in parts:
            if part not in PARTS:
                raise UnknownNameError(f"part reset by {self.name}", part, PARTS)
        return parts


@cache
def names() -> tuple[str, ...]:
    """The adaptations that exist, sorted."""
    found = pkgutil.iter_modules(adaptations.__path__)
    return tuple(sorted(item.name for item in found if item.name != "registry"))


def describe(name: str) -> str:
    """An adaptation in one line."""
    return str(_module(name).DOC)


def parse(text: str) -> Extra:
    """An adaptation from `NAME` or `NAME:PARAMETER=VALUE,...`.

    Raises:
        UnknownNameError: no such adaptation or parameter.
        BnsError: a value that is no positive number.
    """
    name, _, rest = text.partition(":")
    module = _module(name)
    values = dict(module.PARAMETERS)
    for piece in filter(None, rest.split(",")):
        key, _, value = piece.partition("=")
        if key not in values:
            raise UnknownNameError(f"parameter of {name}", key, values)
        values[key] = _number(text, value)
    return Extra(name, tuple(values.items()), module.resets)


def _module(name: str) -> ModuleType:
    if name not in names():
        raise UnknownNameError("adaptation", name, names())
    return import_module(f"bns.learners.bns.adaptations.{name}")


def _number(text: str, value: str) -> float:
    try:
        number = float(value)
    except ValueError:
        number = float("nan")
    if not 0 < number < float("inf"):
        raise BnsError(
            f"{value!r} in adaptation {text!r} is not allowed: give a positive number, "
            "as in population_reset_every:trials=10."
        )
    return number
