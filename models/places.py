"""Where robots lie: here, in installed packages, and in directories of the user's."""

import os
import tomllib
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path

from bns.errors import FormatError, UnknownNameError
from bns.models.robot_model import FACTS

GROUP = "bns.models"
"""entry points of other packages; each is a package whose directory is a robot"""

_HERE = Path(__file__).parent


@cache
def built_in() -> dict[str, Path]:
    """Directories of the robots that come with the project, by name."""
    return {file.parent.name: file.parent for file in sorted(_HERE.glob(f"*/{FACTS}"))}


@cache
def installed() -> dict[str, Path]:
    """Directories of robots in other installed packages, by the entry point's name."""
    found = entry_points(group=GROUP)
    return {entry.name: Path(next(iter(entry.load().__path__))) for entry in found}


def names() -> tuple[str, ...]:
    """Names of all robots that have one, sorted."""
    return tuple(sorted({*built_in(), *installed()}))


def find(robot: str) -> Path:
    """The directory of a robot.

    Args:
        robot: its name, or the path of a directory that holds a `robot.toml`.

    Raises:
        UnknownNameError: no robot is called so, and there is no such directory.
        FormatError: the directory is there and is no robot.
    """
    known = {**installed(), **built_in()}
    if robot in known:
        return known[robot]
    place = Path(robot)
    if not place.is_dir():
        also = f"Or give a directory that holds a {FACTS}."
        raise UnknownNameError("robot", robot, names(), also)
    if not (place / FACTS).is_file():
        raise FormatError(
            f"{robot}{os.sep} holds no {FACTS}: give the directory of a robot, or "
            f"write one (docs/your_robot.md)."
        )
    return place


def known(robot: str) -> bool:
    """Whether a robot is called so, or that is the directory of one."""
    return robot in names() or _robot(Path(robot) / FACTS)


def _robot(file: Path) -> bool:
    """Whether a file describes a robot; what cannot be read counts, to be told of."""
    if not file.is_file():
        return False
    try:
        return "kind" in tomllib.loads(file.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return True
