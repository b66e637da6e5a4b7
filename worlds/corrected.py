"""Worlds that users keep by name: a world and the effects that always hold in it.

They stand in files `worlds.toml`,

    [worlds.kitchen]
    base = "mujoco"
    robot = "khepera3"
    reality = ["wheel_gain:wheel=left,factor=0.85"]
    note = "what it is"

in the working directory and in the user's own (`$XDG_CONFIG_HOME/bns`, by default
`~/.config/bns`); `$BNS_WORLDS` names one file instead of both. The nearer one wins.
"""

import os
import re
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

import msgspec
import tomli_w

from bns.errors import BnsError, FormatError
from bns.storage import files as writing
from bns.storage import reading
from bns.storage.lock import Lock

FILE, VARIABLE = "worlds.toml", "BNS_WORLDS"
NEAR = 2
"""directories above this one that are looked at for worlds kept there"""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
TABLES = "A world has base, robot, note (text) and reality (a list of effects)."


class Entry(msgspec.Struct, forbid_unknown_fields=True):
    """A table of the file."""

    base: str = "mujoco"
    robot: str = "khepera3"
    reality: list[str] = []
    note: str = ""


class Kept(msgspec.Struct, forbid_unknown_fields=True):
    """The file."""

    worlds: dict[str, Any] = {}


@dataclass(frozen=True)
class Corrected:
    """A world with effects that always hold.

    Attributes:
        name: under which it is kept.
        base: the world it is made of.
        robot: name of the robot model.
        reality: effects as text.
        note: what it is, one line.
        file: where it is kept.
    """

    name: str
    base: str
    robot: str
    reality: tuple[str, ...]
    note: str = ""
    file: str = ""


def files() -> tuple[Path, ...]:
    """Where worlds are kept, the nearer first; they need not exist."""
    named = os.environ.get(VARIABLE)
    if named:
        return (Path(named),)
    home = os.environ.get("XDG_CONFIG_HOME") or Path.home() / ".config"
    return (Path(FILE), Path(home) / "bns" / FILE)


def known() -> dict[str, Corrected]:
    """All kept worlds by name.

    Raises:
        FormatError: a file that is not as the module's docstring says.
    """
    found: dict[str, Corrected] = {}
    for path in reversed(files()):
        found |= _read(path)
    return dict(sorted(found.items()))


def elsewhere(name: str) -> Path | None:
    """The file near this directory that keeps a world called `name`, if there is one.

    Looks in the directories above this one and in those beside and below them.
    """
    here = Path.cwd()
    for above in (here, *list(here.parents)[:NEAR]):
        for path in (above / FILE, *sorted(above.glob(f"*/{FILE}"))):
            try:
                if name in _read(path):
                    return path
            except FormatError:
                continue
    return None


def keep(world: Corrected, *, user: bool = False, replace: bool = False) -> Path:
    """Keep a world; gives the file.

    Args:
        world: to keep.
        user: in the user's own file, for all directories.
        replace: one of the same name.

    Raises:
        BnsError: a name that is not allowed or is taken, or a file that can not be
            written.
    """
    if not _NAME.fullmatch(world.name):
        raise BnsError(
            f"{world.name!r} can not name a world: use letters, digits, _ and -."
        )
    path = files()[-1] if user else files()[0]
    with Lock(path.parent):
        found = _read(path)
        if world.name in found and not replace:
            raise BnsError(
                f"{path} has a world {world.name!r} already; give another or --replace."
            )
        found[world.name] = world
        tables = {name: _table(item) for name, item in sorted(found.items())}
        writing.write_text(path, tomli_w.dumps({"worlds": tables}))
    return path


def factory(world: Corrected, make: Callable[..., Any]) -> Callable[..., Any]:
    """What makes a kept world, for the registry.

    Args:
        world: the kept one.
        make: the registry's `make`, for its base.

    Raises:
        BnsError: (by what is returned) the settings name another robot.
    """

    def made(**settings: Any) -> Any:
        """The world, with settings of its own."""
        robot = settings.pop("robot", world.robot)
        if robot != world.robot:
            raise BnsError(
                f"World {world.name!r} is of the robot {world.robot!r}, not {robot!r}."
            )
        given = settings.pop("reality", ())
        reality = [*world.reality, *([given] if isinstance(given, str) else given)]
        named = {"name": world.name, **settings}
        return make(world.base, robot=robot, reality=reality, **named)

    made.made_of = world.base  # type: ignore[attr-defined]
    made.__doc__ = f"{world.base} with {', '.join(world.reality) or 'nothing'}"
    if world.note:
        made.__doc__ += f" ({world.note})"
    return made


def _read(path: Path) -> dict[str, Corrected]:
    if not path.exists():
        return {}
    found = reading.typed(reading.read_toml(path), Kept, path, todo=TABLES)
    items = reading.tables(found.worlds, Entry, path, todo=TABLES)
    return {
        name: Corrected(
            name, item.base, item.robot, tuple(item.reality), item.note, str(path)
        )
        for name, item in items.items()
    }


def _table(world: Corrected) -> dict[str, Any]:
    """A world as it stands in a file."""
    held = {"base": world.base, "robot": world.robot, "reality": list(world.reality)}
    return {**held, "note": world.note} if world.note else held
