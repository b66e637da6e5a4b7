"""A robot model to the rest of the project (`RobotModel`), and where robots lie."""

import os
import tomllib
from collections.abc import Mapping
from dataclasses import dataclass, field
from functools import cache
from importlib.metadata import entry_points
from pathlib import Path
from typing import Any, NamedTuple

import msgspec
import numpy as np

from bns.errors import FormatError, UnknownNameError
from bns.storage import reading
from bns.storage.reading import Finite, Name, Positive

FACTS = "robot.toml"


class Channel(NamedTuple):
    """One measured or commanded quantity."""

    name: str
    unit: str


class CommandChannel(NamedTuple):
    """What the robot can be told, one number at a time.

    Attributes:
        name: "left_speed".
        unit: SI.
        low, high: smallest and largest value that the robot accepts.
        actuator: name of the actuator that it goes to.
    """

    name: str
    unit: str
    low: float
    high: float
    actuator: str


class Wheel(NamedTuple):
    """Names of one driven wheel's parts in the model."""

    body: str
    joint: str
    geom: str
    actuator: str


class Option(NamedTuple):
    """A choice that `models.spec` offers for this robot.

    Attributes:
        doc: one line.
        default: what the XML holds.
        headings: per alternative, heading [deg] of each sensor site it turns.
    """

    doc: str
    default: str
    headings: Mapping[str, Mapping[str, float]]


class CommandTable(msgspec.Struct, forbid_unknown_fields=True):
    """A command in the file, see `CommandChannel`."""

    name: Name
    unit: str
    low: Finite
    high: Finite
    actuator: Name


class WheelTable(msgspec.Struct, forbid_unknown_fields=True):
    """A wheel in the file, see `Wheel`."""

    body: Name
    joint: Name
    geom: Name
    actuator: Name


class OptionTable(msgspec.Struct, forbid_unknown_fields=True):
    """An option in the file, see `Option`."""

    doc: str
    default: str
    headings: dict[str, dict[str, Finite]]


class Facts(msgspec.Struct, forbid_unknown_fields=True):
    """The file, see `RobotModel`."""

    kind: str
    doc: str
    commands: list[CommandTable]
    base_body: str
    base_joint: str
    tracker_site: str
    picture: str
    ctrl_per_command: Positive | None = None
    nominal_wheel_radius: Positive | None = None
    sensor_sites: list[str] = []
    light: dict[str, Finite | str] = {}
    wheels: dict[str, WheelTable] = {}
    caster_geom: str = ""
    options: dict[str, OptionTable] = {}
    servo: str = ""


@dataclass(frozen=True, eq=False)
class RobotModel:
    """One robot directory: its files, and the names of what is in its model.

    Attributes:
        name: of the robot and of its directory.
        kind: "wheeled", "legged" or "servo".
        doc: one line.
        directory: where `<name>.xml`, `scene.xml` and the rest lie.
        commands: what it can be told, in the order of the model's controls.
        ctrl_per_command: control units per unit of command; for wheels 1 / nominal
            radius: 1 m/s becomes so many rad/s.
        base_body: the body that carries everything.
        base_joint: its free joint; of a servo on a stand, its shaft.
        tracker_site: what an overhead camera tracks.
        picture: camera of the scene for the portrait.
        sensor_sites: in the order of the robot's readings; they look along their z.
            Light sensors have the names of `bns.models.light_sites`.
        light: what those do, where it is not as usual (`bns.worlds.light.sensors`).
        wheels: driven wheels by side, "left" and "right".
        caster_geom: "" where there is none.
        options: what else `models.spec` takes.
        servo: module of `bns.models` with the numbers of its servos, "law.toml" where
            they are in its directory; "" = it has none.
    """

    name: str
    kind: str
    doc: str
    directory: Path
    commands: tuple[CommandChannel, ...]
    ctrl_per_command: float
    base_body: str
    base_joint: str
    tracker_site: str
    picture: str
    sensor_sites: tuple[str, ...] = ()
    light: Mapping[str, float | str] = field(default_factory=dict)
    wheels: Mapping[str, Wheel] = field(default_factory=dict)
    caster_geom: str = ""
    options: Mapping[str, Option] = field(default_factory=dict)
    servo: str = ""

    @property
    def channels(self) -> tuple[Channel, ...]:
        """Names and units of the commands."""
        return tuple(Channel(c.name, c.unit) for c in self.commands)

    @property
    def ranges(self) -> np.ndarray:
        """Smallest and largest value of each command, shape ``(C, 2)``, SI units."""
        return np.array([(c.low, c.high) for c in self.commands])

    @property
    def limits(self) -> np.ndarray:
        """Largest magnitude of each command, shape ``(C,)``, SI units."""
        return np.array([max(-c.low, c.high) for c in self.commands])

    @property
    def actuators(self) -> dict[str, str]:
        """Name of the actuator that each command goes to."""
        return {c.name: c.actuator for c in self.commands}

    @property
    def xml(self) -> Path:
        """The robot alone."""
        return self.directory / f"{self.name}.xml"

    @property
    def scene(self) -> Path:
        """The robot with a floor and a light."""
        return self.directory / "scene.xml"


def read(directory: Path) -> RobotModel:
    """The robot described in a directory's `robot.toml`.

    Raises:
        FormatError: it is not TOML, or an entry is missing or unknown.
    """
    file = directory / FACTS
    todo = "Compare it with that of another robot."
    said = reading.typed(reading.read_toml(file), Facts, file, todo=todo)
    facts = msgspec.structs.asdict(said)
    radius = facts.pop("nominal_wheel_radius")
    if (radius is None) == (said.ctrl_per_command is None):
        raise FormatError(
            f"{file} needs one of ctrl_per_command and nominal_wheel_radius. {todo}"
        )
    for command in said.commands:
        if not command.low < command.high:
            raise FormatError(f"{file}: {command.name} needs low < high.")
    names = [command.name for command in said.commands]
    if len(set(names)) < len(names) or not names:
        raise FormatError(f"{file} lists no command, or one twice.")
    facts["ctrl_per_command"] = 1.0 / radius if radius else said.ctrl_per_command
    facts["commands"] = tuple(_named(CommandChannel, c) for c in said.commands)
    facts["wheels"] = {side: _named(Wheel, w) for side, w in said.wheels.items()}
    facts["options"] = {name: _named(Option, o) for name, o in said.options.items()}
    facts["sensor_sites"] = tuple(said.sensor_sites)
    return RobotModel(name=directory.resolve().name, directory=directory, **facts)


def _named(kind: type[Any], table: msgspec.Struct) -> Any:
    """A table of the file as the tuple that it is elsewhere."""
    return kind(**msgspec.structs.asdict(table))


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
