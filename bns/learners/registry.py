"""Finding learners by name."""

import pkgutil
from functools import cache
from importlib import import_module
from types import ModuleType

import bns.learners
from bns.errors import UnknownNameError


@cache
def names() -> tuple[str, ...]:
    """The learners that exist, sorted."""
    found = pkgutil.iter_modules(bns.learners.__path__)
    return tuple(sorted(item.name for item in found if item.name != "registry"))


def describe(name: str) -> str:
    """A learner in one line."""
    return str(get(name).DOC)


def get(name: str) -> ModuleType:
    """The module of a learner, see `bns.learners`.

    Raises:
        UnknownNameError: no such learner.
    """
    if name not in names():
        raise UnknownNameError("learner", name, names())
    return import_module(f"bns.learners.{name}")


def dearness(name: str) -> float:
    """Cost of a learner's generation, that of navigation being 1."""
    return float(getattr(get(name), "DEARNESS", 1.0))
