"""Tasks by name: one TOML file each, in this directory or in that of another package.

An installed package adds one by the entry point `bns.tasks`: its name is the task's,
its value a package whose directory holds `NAME.toml`, with

    description = "what it is, one line"
    kind = "park"                       # one of ours, or a module of that package

and what the kind needs beside. A module of its own has to define `TASK`, a subclass of
`bns.tasks.base.Task`.
"""

from functools import cache
from importlib import import_module
from importlib.metadata import entry_points
from importlib.resources import files
from importlib.resources.abc import Traversable
from typing import Any

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.experiment.config import RunConfig
from bns.storage import reading
from bns.tasks.base import Task

GROUP = "bns.tasks"
"""entry points of other packages"""


@cache
def _here() -> tuple[str, ...]:
    found = (entry.name for entry in files("bns.tasks").iterdir())
    return tuple(n.removesuffix(".toml") for n in found if n.endswith(".toml"))


@cache
def _installed() -> dict[str, Any]:
    return {entry.name: entry for entry in entry_points(group=GROUP)}


@cache
def names() -> tuple[str, ...]:
    """The tasks that exist, sorted.

    Raises:
        BnsError: another package takes the name of a task.
    """
    for name in _installed():
        if name in _here():
            raise BnsError(
                f"The entry point {name!r} of {GROUP} takes the name of a task that "
                "exists: give it another."
            )
    return tuple(sorted((*_here(), *_installed())))


@cache
def content(name: str) -> dict[str, Any]:
    """What a task's file says.

    Raises:
        UnknownNameError: there is no such task.
        BnsError: another package says it has it, and has no such file.
        FormatError: the file lacks description or kind.
    """
    if name not in names():
        raise UnknownNameError("task", name, names())
    package = _installed()[name].value if name in _installed() else "bns.tasks"
    file = _directory(name, package) / f"{name}.toml"
    if not file.is_file():
        raise BnsError(f"Task {name!r}: the package {package} holds no {name}.toml.")
    found = reading.toml(file.read_text(encoding="utf-8"), file)
    for key in ("description", "kind"):
        if not isinstance(found.get(key), str):
            raise FormatError(f"{file} lacks the text {key!r}.")
    return found


def _directory(name: str, package: str) -> Traversable:
    try:
        return files(package)
    except (ImportError, TypeError) as error:
        raise BnsError(
            f"Task {name!r} cannot be had from {package!r}, as its entry point in "
            f"{GROUP} says: {error}."
        ) from error


def describe(name: str) -> str:
    """The task in one line."""
    return str(content(name)["description"])


def kind(name: str) -> str:
    """What sort of task it is: the module that runs and scores it, of `bns.tasks` or,
    with dots in its name, of another package."""
    return str(content(name)["kind"])


def kinds() -> tuple[str, ...]:
    """The sorts of tasks that exist, sorted."""
    return tuple(sorted({kind(name) for name in names()}))


def of(config: RunConfig) -> Task:
    """The task of a configuration.

    Raises:
        UnknownNameError: no such task.
        BnsError: a setting that the task cannot be with, or a kind of another package
            that is not there.
    """
    sort = kind(config.task.name)
    place = sort if "." in sort else f"bns.tasks.{sort}"
    try:
        module = import_module(place)
    except ModuleNotFoundError as error:
        if error.name is None or not place.startswith(error.name):
            raise  # a package that is missing inside
        raise BnsError(
            f"Task {config.task.name!r} is of the kind {sort!r}, and there is no "
            f"module {place}."
        ) from error
    made: Task = module.TASK(config)
    return made
