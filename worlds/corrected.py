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

import json
import os
import re
import tomllib
from collections.abc import Callable
from dataclasses import dataclass
from pathlib import Path
from typing import Any

from bns.errors import BnsError, FormatError

FILE, VARIABLE = "worlds.toml", "BNS_WORLDS"
NEAR = 2
"""directories above this one that are looked at for worlds kept there"""
_NAME = re.compile(r"[A-Za-z0-9][A-Za-z0-9_-]*")
_KEYS = {"base": str, "robot": str, "reality": list, "note": str}


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
    found = _read(path)
    if world.name in found and not replace:
        raise BnsError(
            f"{path} has a world {world.name!r} already; give another or --replace."
        )
    found[world.name] = world
    text = "\n".join(_text(item) for _, item in sorted(found.items()))
    try:
        path.parent.mkdir(parents=True, exist_ok=True)
        path.write_text(text, encoding="utf-8")
    except OSError as error:
        raise BnsError(f"{path} cannot be written: {error.strerror}.") from error
    return path


def factory(world: Corrected, make: Callable[..., Any]) -> Callable[..., Any]:
    """What makes a kept world, for the registry.

    Args:
        world: the kept one.
        make: the registry's `make`, for its base.
    """

    def made(**settings: Any) -> Any:
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
    if not path.is_file():
        return {}
    try:
        content = tomllib.loads(path.read_text(encoding="utf-8"))
        tables = content["worlds"] if content else {}
        items = {name: dict(table) for name, table in tables.items()}
    except (OSError, ValueError, KeyError, TypeError, AttributeError) as error:
        raise FormatError(f"{path} holds no worlds ({error}).") from None
    return {name: _world(name, table, path) for name, table in items.items()}


def _world(name: str, table: dict[str, Any], path: Path) -> Corrected:
    for key, value in table.items():
        if key not in _KEYS or not isinstance(value, _KEYS[key]):
            raise FormatError(
                f"{path}: world {name!r} has {key} = {value!r}; it takes base, robot, "
                "note (text) and reality (a list of effects)."
            )
    return Corrected(
        name,
        table.get("base", "mujoco"),
        table.get("robot", "khepera3"),
        tuple(map(str, table.get("reality", ()))),
        table.get("note", ""),
        str(path),
    )


def _text(world: Corrected) -> str:
    lines = [
        f"[worlds.{world.name}]",
        f"base = {json.dumps(world.base)}",
        f"robot = {json.dumps(world.robot)}",
        f"reality = {json.dumps(list(world.reality))}",
    ]
    if world.note:
        lines.append(f"note = {json.dumps(world.note, ensure_ascii=False)}")
    return "\n".join(lines) + "\n"
