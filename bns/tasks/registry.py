"""Tasks by name: one TOML file each in this directory."""

import tomllib
from functools import cache
from importlib import import_module
from importlib.resources import files
from typing import Any

from bns.errors import UnknownNameError
from bns.experiment.config import RunConfig
from bns.tasks.base import Task


@cache
def names() -> tuple[str, ...]:
    """The tasks that exist, sorted."""
    found = (entry.name for entry in files("bns.tasks").iterdir())
    return tuple(sorted(n.removesuffix(".toml") for n in found if n.endswith(".toml")))


@cache
def content(name: str) -> dict[str, Any]:
    """What a task's file says.

    Raises:
        UnknownNameError: there is no such task.
    """
    if name not in names():
        raise UnknownNameError("task", name, names())
    return tomllib.loads((files("bns.tasks") / f"{name}.toml").read_text())


def describe(name: str) -> str:
    """The task in one line."""
    return str(content(name)["description"])


def kind(name: str) -> str:
    """What sort of task it is: the module of `bns.tasks` that runs and scores it."""
    return str(content(name)["kind"])


def kinds() -> tuple[str, ...]:
    """The sorts of tasks that exist, sorted."""
    return tuple(sorted({kind(name) for name in names()}))


def of(config: RunConfig) -> Task:
    """The task of a configuration.

    Raises:
        UnknownNameError: no such task.
        BnsError: a setting that the task cannot be with.
    """
    module = import_module(f"bns.tasks.{kind(config.task.name)}")
    made: Task = module.TASK(config)
    return made
