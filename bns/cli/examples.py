"""`bns examples`: the examples that come with the package, listed, shown or copied."""

import ast
import shutil
from dataclasses import dataclass
from pathlib import Path

from bns.cli.fields import Positional
from bns.cli.parse import parse
from bns.cli.tables import show
from bns.errors import BnsError, UnknownNameError

PLACE = Path(__file__).parents[1] / "examples"
LEFT_OUT = shutil.ignore_patterns("__pycache__", "*.pyc", ".*")


@dataclass(frozen=True, kw_only=True)
class Arguments:
    """List the examples, print one, or copy them all: scripts of less than 100 lines,
    notebooks, robots, and a package that adds to the testbed.
    """

    name: Positional[str] = ""
    """script to print, such as 01_drive_a_robot"""
    copy: str = ""
    """directory to copy all examples to; must not be there yet"""
    json: bool = False
    """print JSON instead of a table"""


def main(verb: str, argv: list[str]) -> int:
    """Run the verb; gives the exit code.

    Args:
        verb: "examples".
        argv: words after it.

    Raises:
        UnknownNameError: no such example.
        BnsError: the directory to copy to exists, or cannot be written.
    """
    del verb
    given = parse(Arguments, argv, prog="bns examples")
    if given.copy:
        return _copy(Path(given.copy))
    scripts = {path.stem: path for path in sorted(PLACE.glob("*.py"))}
    if not given.name:
        rows = [[name, says(path)] for name, path in scripts.items()]
        show(["example", "what it shows"], rows, json=given.json)
        if not given.json:
            print("Read one: bns examples NAME. Take all: bns examples --copy DIR.")
        return 0
    name = given.name.removesuffix(".py")
    if name not in scripts:
        raise UnknownNameError("example", given.name, scripts)
    print(scripts[name].read_text(encoding="utf-8"), end="")
    return 0


def says(path: Path) -> str:
    """The first line of a script's docstring."""
    text = ast.get_docstring(ast.parse(path.read_text(encoding="utf-8"))) or ""
    return text.split("\n", 1)[0]


def _copy(to: Path) -> int:
    if to.exists():
        raise BnsError(f"{to} exists and is not overwritten; give another directory.")
    try:
        shutil.copytree(PLACE, to, ignore=LEFT_OUT)
    except OSError as error:
        raise BnsError(f"{to} cannot be written: {error}.") from error
    print(f"examples:  {to}")
    return 0
