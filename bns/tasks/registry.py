"""Tasks by name: one TOML file each in this directory."""

import tomllib
from functools import cache
from importlib.resources import files
from typing import Any

from bns.errors import UnknownNameError


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


def order(name: str) -> str:
    """Letters of the objectives, in the order in which they are to be reached."""
    return str(content(name)["order"])
