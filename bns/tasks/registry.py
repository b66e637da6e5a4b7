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
from types import ModuleType
from typing import Any

from bns.errors import BnsError, FormatError, UnknownNameError, refused
from bns.experiment.config import RunConfig
from bns.experiment.task_settings import TaskConfig
from bns.storage import reading
from bns.tasks.base import Task

GROUP = "bns.tasks"
"""entry points of other packages"""
SAID = ("description", "kind")
"""keys of every task's file"""
_NO_KINDS = ("__init__", "base", "light_controller", "registry", "route_file")


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
    found = reading.toml(_text(file), file)
    for key in SAID:
        if not isinstance(found.get(key), str):
            raise FormatError(f"{file} lacks the text {key!r}.")
    return found


def _text(file: Traversable) -> str:
    try:
        return file.read_text(encoding="utf-8")
    except (OSError, UnicodeDecodeError) as error:
        raise FormatError(f"{file} cannot be read as text: {error}.") from error


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


def faults() -> dict[str, BnsError]:
    """Tasks whose file cannot be read, and what is wrong with each."""
    return refused(names(), content)


def readable() -> tuple[str, ...]:
    """The tasks whose file can be read, sorted."""
    bad = faults()
    return tuple(name for name in names() if name not in bad)


def kinds() -> tuple[str, ...]:
    """The sorts of tasks that exist, sorted."""
    return tuple(sorted({kind(name) for name in readable()}))


def own_kinds() -> tuple[str, ...]:
    """The modules of `bns.tasks` that run and score tasks, sorted."""
    found = (entry.name for entry in files("bns.tasks").iterdir())
    modules = (n.removesuffix(".py") for n in found if n.endswith(".py"))
    return tuple(sorted(name for name in modules if name not in _NO_KINDS))


def of(config: RunConfig) -> Task:
    """The task of a configuration.

    Raises:
        UnknownNameError: no such task, no such kind, or a key of the task's file that
            its kind does not read.
        BnsError: a setting that the task cannot be with, or a kind of another package
            that is not there.
    """
    name = config.task.name
    sort = kind(name)
    if "." not in sort and sort not in own_kinds():
        raise UnknownNameError(f"kind of the task {name!r}", sort, own_kinds())
    made: type[Task] | None = getattr(_module(name, sort), "TASK", None)
    if made is None:
        raise BnsError(
            f"Task {name!r}: the module {sort} has no TASK; let it be its subclass of "
            "bns.tasks.base.Task."
        )
    _check_keys(name, made)
    return made(config)


def _module(name: str, sort: str) -> ModuleType:
    place = sort if "." in sort else f"bns.tasks.{sort}"
    try:
        return import_module(place)
    except ModuleNotFoundError as error:
        if error.name is None or not place.startswith(error.name):
            raise  # a package that is missing inside
        raise BnsError(
            f"Task {name!r} is of the kind {sort!r}, and there is no module {place}: "
            f"give one of {', '.join(own_kinds())}, or a module of your package."
        ) from error


def _check_keys(name: str, kind: type[Task]) -> None:
    """Refuse what a task's file says and nothing reads."""
    own = vars(kind).get("keys")  # a subclass may read more
    if own is None:
        return
    known = (*SAID, *own)
    for key in content(name):
        if key not in known:
            setting = key in TaskConfig.__dataclass_fields__
            also = f"It is a setting: give --task.{key}." if setting else ""
            raise UnknownNameError(f"key of the task {name!r}", key, known, also)
