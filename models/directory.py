"""Directories of robots that are made of a few numbers: names, templates, files."""

import re
from collections.abc import Mapping
from pathlib import Path
from typing import Any, overload

from bns.errors import BnsError
from bns.storage import files as writing

DIGITS = 5  # of what is computed


def named(directory: Path) -> str:
    """The name that a robot gets from its directory, which is to be made.

    Raises:
        BnsError: a name that no model can have, or that another has; something is
            there already.
    """
    from bns import models

    if not re.fullmatch(r"[A-Za-z]\w*", directory.name, re.ASCII):
        raise BnsError(
            f"{directory.name!r} cannot be a robot's name: give a directory whose name "
            "is made of letters, digits and underscores."
        )
    if directory.exists():
        raise BnsError(f"{directory} is there already: give another name.")
    if directory.name in models.names():
        raise BnsError(
            f"{directory.name!r} is the name of a robot already (`bns robots`): give "
            "another."
        )
    return directory.name


def text(template: str, content: Mapping[str, Any]) -> str:
    """A template of `bns/models/templates` with its content put in."""
    from jinja2 import Environment, PackageLoader, StrictUndefined

    environment = Environment(
        loader=PackageLoader("bns.models", "templates"),
        undefined=StrictUndefined,
        trim_blocks=True,
        keep_trailing_newline=True,
    )
    return environment.get_template(template).render(content)


def texts(
    name: str, templates: Mapping[str, str], content: Mapping[str, Any]
) -> dict[str, str]:
    """A robot's files by their names, of templates by those (`{name}`: the robot's).

    Args:
        name: of the robot.
        templates: name of each file's template, by the file's name, in which
            ``{name}`` may stand.
        content: what the templates are filled with, by name.
    """
    return {
        file.format(name=name): text(template, content)
        for file, template in templates.items()
    }


def make(directory: Path, files: Mapping[str, str]) -> None:
    """Make the directory, with files of some text in it.

    Raises:
        BnsError: it cannot be written.
    """

    def fill(temporary: Path) -> None:
        temporary.mkdir()
        for name, content in files.items():
            writing.write_text(temporary / name, content)

    writing.make_directory(directory.parent)
    writing.replace(directory, fill)


@overload
def short(value: float) -> float: ...


@overload
def short(value: list[float]) -> list[float]: ...


@overload
def short(value: float | list[float]) -> float | list[float]: ...


def short(value: float | list[float]) -> float | list[float]:
    """Rounded to a few digits."""
    if isinstance(value, list):
        return [float(f"{each:.{DIGITS}g}") for each in value]
    return float(f"{value:.{DIGITS}g}")
