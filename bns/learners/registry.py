"""Finding learners by name; scripts and packages may add theirs.

An installed package adds one by the entry point `bns.learners`, a script by `register`.
"""

import pkgutil
from collections.abc import Callable
from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from typing import TYPE_CHECKING, Any

import bns.learners
from bns.errors import BnsError, UnknownNameError, missing, refused
from bns.learners.bns.config import BNS_SECTIONS

if TYPE_CHECKING:
    from bns.learners.base import Learner

GROUP = "bns.learners"
_NO_LEARNERS = ("base", "contract", "registry")
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


def faults() -> dict[str, BnsError]:
    """Learners that cannot be used, and what is wrong with each."""
    return refused(names(), get)


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
        BnsError: the name of a task, or a learner whose file is not as it should be.
        ModuleNotFoundError: an extra of this package that it needs.
    """
    if name in _registered:
        return _registered[name]
    if name in _here():
        place = _here()[name]
        return _loaded(name, place, lambda: import_module(place).LEARNER)
    if name in _installed():
        entry = _installed()[name]
        return _loaded(name, entry.value, entry.load)
    from bns.tasks import registry as tasks

    if name in (*tasks.names(), *tasks.kinds()):
        raise BnsError(
            f"learner = {name!r} is what is learned, not who learns it: give "
            f"--task.name, and as learner one of {', '.join(names())}."
        )
    raise UnknownNameError("learner", name, names())


def _loaded(name: str, place: str, load: Callable[[], Any]) -> "type[Learner]":
    """The learner that `load` gives, or a `BnsError` that says where and why not."""
    from bns.learners.base import Learner

    try:
        found = load()
    except ModuleNotFoundError as error:
        if missing(error):
            raise
        raise _unusable(name, place, f"No module {error.name!r}") from error
    except Exception as error:  # a file that anyone may have written
        said = f"{type(error).__name__}: {error}"
        if isinstance(error, AttributeError) and error.name == "LEARNER":
            said = "it has no LEARNER: let it be its subclass of Learner"
        raise _unusable(name, place, said) from error
    if not (isinstance(found, type) and issubclass(found, Learner)):
        said = (
            f"its learner is {found!r}, to be a subclass of bns.learners.base.Learner"
        )
        raise _unusable(name, place, said)
    return found


def _unusable(name: str, place: str, why: str) -> BnsError:
    file = place if name in _installed() else f"{place.replace('.', '/')}.py"
    return BnsError(f"Learner {name!r} ({file}) cannot be used: {why.rstrip('.')}.")
