"""Finding learners by name; scripts and packages may add theirs.

An installed package adds one by the entry point `bns.learners`, a script by `register`.
"""

import pkgutil
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

import bns.learners
from bns.errors import BnsError, UnknownNameError
from bns.learners.bns.config import BNS_SECTIONS

if TYPE_CHECKING:
    from bns.learners.base import Learner

GROUP = "bns.learners"
_NO_LEARNERS = ("base", "registry")
_registered: dict[str, "type[Learner]"] = {}


def register(name: str, learner: "type[Learner]") -> None:
    """Make a learner known under a name, in this process.

    Raises:
        BnsError: the name is taken by another one.
    """
    if name in names() and _registered.get(name) is not learner:
        raise BnsError(f"A learner called {name!r} exists already; take another name.")
    _registered[name] = learner


@cache
def _here() -> dict[str, str]:
    """Modules of the learners in this package, by name."""
    return {
        item.name: f"bns.learners.{item.name}" + (".learner" if item.ispkg else "")
        for item in pkgutil.iter_modules(bns.learners.__path__)
        if item.name not in _NO_LEARNERS
    }


@cache
def _installed() -> dict[str, Any]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


def names() -> tuple[str, ...]:
    """The learners that exist, sorted."""
    return tuple(sorted({*_here(), *_installed(), *_registered}))


def describe(name: str) -> str:
    """A learner in one line."""
    doc = import_module(get(name).__module__).__doc__ or ""
    return doc.split("\n", 1)[0]


def sections(name: str) -> tuple[str, ...]:
    """Sections and settings of a configuration that a learner has beside `settings`.

    Those of bns are known without loading it.

    Raises:
        UnknownNameError: no such learner.
    """
    return BNS_SECTIONS if name == "bns" else get(name).sections


def get(name: str) -> "type[Learner]":
    """A learner by name.

    Raises:
        UnknownNameError: no such learner.
        BnsError: the name of a task.
    """
    if name in _registered:
        return _registered[name]
    if name in _here():
        found: type[Learner] = import_module(_here()[name]).LEARNER
        return found
    if name in _installed():
        loaded: type[Learner] = _installed()[name].load()
        return loaded
    from bns.tasks import registry as tasks

    if name in (*tasks.names(), *tasks.kinds()):
        raise BnsError(
            f"learner = {name!r} is what is learned, not who learns it: give "
            f"--task.name, and as learner one of {', '.join(names())}."
        )
    raise UnknownNameError("learner", name, names())
