"""The TOML file that describes a model of one's own; see docs/gap_your_robot.md."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.gap.importers.tables import SENT, TIME, TRIAL
from bns.storage import reading
from bns.storage.reading import BEYOND
from bns.worlds.data.importing import Source, read_map
from bns.worlds.data.units import FACTORS, si_unit
from bns.worlds.effects import parts
from bns.worlds.trial import Channel

KEYS = (
    "name",
    "model",
    "held",
    "window",
    "commands",
    "observed",
    "start",
    "effects",
    "bounds",
    "log",
)
FLOOR = ("x", "y", "yaw")  # axes of what goes over a floor
START = ("keyframe", "recorded", "settle", "cut")
LOOP = ("kp", "kd", "torque")
"""of a position loop that the MJCF file lacks"""

PLACES = ("site", "body")
QUANTITIES = ("joint", "speed", *PLACES, "tendon", "gyro")
"""what an observed channel can be: position or speed of a joint, place of a site or
body, or how that is turned, length of a tendon, rate that a gyro of the model reads"""
AXES = ("x", "y", "z")
TURNS = ("roll", "pitch", "yaw")
"""how a site or body is turned in the world: by yaw, pitch and roll, in this order,
about its own z, y and x axes"""
UNITS = ("rad", "m", "rad/s", "m/s")
MARKS = (TIME, TRIAL, SENT)  # columns of a log beside its channels
WINDOW = 0.1  # [s] between two samples that are compared


@dataclass(frozen=True)
class Told:
    """A command channel.

    Attributes:
        channel: name and unit.
        actuator: of the model; one without a name goes by that of its joint.
        low, high: limits of the command.
        kp, kd: gains of a position loop around the actuator [N m/rad, N m s/rad, or
            N/m, N s/m]; kp = 0: the command is the actuator's own control.
        torque: largest torque or force of that loop [N m or N]; infinity = any.
    """

    channel: Channel
    actuator: str
    low: float
    high: float
    kp: float = 0.0
    kd: float = 0.0
    torque: float = np.inf


@dataclass(frozen=True)
class Seen:
    """An observed channel.

    Attributes:
        channel: name and unit.
        quantity: one of `QUANTITIES`.
        part: name of the joint, site, body, tendon or gyro.
        axis: of a site or body, in the world frame: number among `AXES` and `TURNS`; of
            a gyro its own, among `AXES`.
        noise: standard deviation of its measurement, in its unit.
        scatter: of what the robot itself scatters, per square root of a second.
        floats: whether it tells, with others, the state of a free body
            (`floating.told`).
    """

    channel: Channel
    quantity: str
    part: str
    axis: int
    noise: float
    scatter: float
    floats: bool = False

    @property
    def state(self) -> str:
        """What it tells of the state in which a trial begins: a joint, by its name, or
        the way of a free body; "" = nothing."""
        joint = self.part if self.quantity == "joint" else ""
        return f"{self.part}.{self.way}" if self.floats else joint

    @property
    def way(self) -> str:
        """The axis of a site or body, of `AXES` and `TURNS`; "" of what has none."""
        return (*AXES, *TURNS)[self.axis] if self.quantity in PLACES else ""

    @property
    def turning(self) -> bool:
        """Whether it is how a site or body is turned, and not where that is."""
        return self.way in TURNS


@dataclass(frozen=True)
class OwnConfig:
    """A described model.

    Attributes:
        name: of the robot; recordings carry it.
        model: its MJCF file.
        told, seen: channels.
        held: bodies on free joints that a stand holds where they are, off the ground.
        keyframe: pose at the start of each trial; "" = the model's own.
        recorded: whether observed joints start where they were recorded.
        settle: how long the robot stands at rest before a trial [s].
        cut: length of the pieces that long recordings are cut into [s]; 0 = none.
        window: see `WINDOW`.
        effects: parts by effect; None = all that make sense.
        bounds: by candidate: low, high, slack.
        log: columns of CSV logs by channel; empty = their own names.
    """

    name: str
    model: Path
    told: tuple[Told, ...]
    seen: tuple[Seen, ...]
    held: tuple[str, ...] = ()
    keyframe: str = ""
    recorded: bool = False
    settle: float = 0.0
    cut: float = 0.0
    window: float = WINDOW
    effects: Mapping[str, tuple[str, ...]] | None = None
    bounds: Mapping[str, Mapping[str, float]] = field(default_factory=dict)
    log: Mapping[str, Source] = field(default_factory=dict)

    @property
    def over_floor(self) -> Mapping[tuple[str, str], Mapping[str, int]]:
        """Columns by axis, those of `FLOOR`, of each site and body by kind and name."""
        found: dict[tuple[str, str], dict[str, int]] = {}
        for column, item in enumerate(self.seen):
            if item.way in FLOOR:
                found.setdefault((item.quantity, item.part), {})[item.way] = column
        return found

    @property
    def followed(self) -> Mapping[str, list[int]]:
        """Columns of x, y and yaw of each site and body of which all are observed."""
        return {
            part: [columns[way] for way in FLOOR]
            for (_, part), columns in self.over_floor.items()
            if len(columns) == len(FLOOR)
        }

    def tracked(self, part: str) -> dict[str, list[int]]:
        """Columns of x, y and yaw of each place that an effect is on, by name.

        Args:
            part: name of a site or body, a pattern, or "all".

        Raises:
            UnknownNameError: x, y and yaw of it are not observed.
        """
        followed = self.followed
        names = [*followed]
        kind = "tracked place (a body or site whose x, y and yaw are observed)"
        on = (names[n] for n in parts.among(names, part, kind))
        return {name: followed[name] for name in on}

    @classmethod
    def read(cls, path: str | Path) -> "OwnConfig":
        """The description in a TOML file.

        Raises:
            FormatError: no such file, not TOML, or something of it missing.
            BnsError: an unknown key, unit or quantity.
        """
        path = Path(path)
        given = reading.read_toml(path)
        _known(given, KEYS, f"key of {path}")
        for key in ("name", "model", "commands", "observed"):
            if not given.get(key):
                raise FormatError(
                    f"{path} lacks {key!r}; see docs/gap_your_robot.md for an example."
                )
        if not isinstance(given["commands"], dict) or not isinstance(
            given["observed"], dict
        ):
            raise FormatError(f"{path}: commands and observed have to be tables.")
        start = _table(given, "start", path)
        _known(start, START, f"key of [start] in {path}")
        bounds = _table(given, "bounds", path)
        effects = _table(given, "effects", path) if "effects" in given else None
        return cls(
            name=str(given["name"]),
            model=path.parent / str(given["model"]),
            told=tuple(_told(n, t, path) for n, t in given["commands"].items()),
            seen=tuple(_seen(n, t, path) for n, t in given["observed"].items()),
            held=_names(given.get("held", ())),
            keyframe=str(start.get("keyframe", "")),
            recorded=bool(start.get("recorded", False)),
            settle=_number(start.get("settle", 0.0), "settle", path, 0.0, 60.0),
            cut=_cut(start, path),
            window=_number(given.get("window", WINDOW), "window", path, 1e-3, 60.0),
            effects=None
            if effects is None
            else {name: _names(parts) for name, parts in effects.items()},
            bounds={name: _bounds(name, row, path) for name, row in bounds.items()},
            log={n: _source(n, s, path) for n, s in _table(given, "log", path).items()},
        )

    def mapped(self, path: str | Path) -> "OwnConfig":
        """The same with the columns of logs that a map names; [log] says the others.

        Args:
            path: TOML file as in docs/formats.md, by the channels of this robot.

        Raises:
            FormatError: no such file, not TOML, or no table `columns`.
            BnsError: a map of another robot.
            UnknownNameError: a key or channel that there is not.
        """
        path = Path(path)
        robot, columns, units = read_map(path)
        if robot not in (None, self.name):
            raise BnsError(f"{path} is of robot {robot!r}, the model of {self.name!r}.")
        if not columns:
            raise FormatError(f"Column map {path} names no column in [columns].")
        told = (item.channel.name for item in self.told)
        seen = (item.channel.name for item in self.seen)
        _known(columns, (*MARKS, *told, *seen), f"channel in {path}")
        named = {
            name: _source(name, {"column": column, "unit": units.get(name, "")}, path)
            for name, column in columns.items()
        }
        return replace(self, log={**self.log, **named})


def _known(given: Mapping[str, Any], allowed: tuple[str, ...], kind: str) -> None:
    for key in given:
        if key not in allowed:
            raise UnknownNameError(kind, key, allowed)


def _table(given: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Any]:
    table = given.get(key, {})
    if not isinstance(table, dict):
        raise FormatError(f"{path}: {key!r} has to be a table, [{key}].")
    return table


def _names(parts: Any) -> tuple[str, ...]:
    listed = parts if isinstance(parts, list | tuple) else (parts,)
    return tuple(map(str, listed))


def _told(name: str, table: Any, path: Path) -> Told:
    kind = f"key of [commands.{name}] in {path}"
    table = _mapping(table, f"[commands.{name}]", path)
    _known(table, ("actuator", "unit", "low", "high", *LOOP), kind)
    for key in ("actuator", "unit", "low", "high"):
        if key not in table:
            raise FormatError(f"{path}: [commands.{name}] lacks {key!r}.")
    low, high = (_number(table[key], key, path) for key in ("low", "high"))
    if not low < high:
        raise BnsError(f"{path}: [commands.{name}] needs low < high.")
    channel = _channel(name, table["unit"], path)
    loop = {key: _number(table[key], key, path) for key in LOOP if key in table}
    if loop and not (loop.get("kp", 0) > 0 and min(loop.values()) >= 0):
        raise BnsError(
            f"{path}: the loop of [commands.{name}] needs a positive kp, and kd and "
            "torque not below 0."
        )
    return Told(channel, str(table["actuator"]), low, high, **loop)


def _cut(start: Mapping[str, Any], path: Path) -> float:
    cut = _number(start.get("cut", 0.0), "cut", path)
    if cut < 0 or (cut and not start.get("recorded")):
        raise BnsError(
            f"{path}: [start] cut is a positive length in seconds, and needs "
            "recorded = true: pieces begin where the robot was."
        )
    return cut


def _seen(name: str, table: Any, path: Path) -> Seen:
    table = _mapping(table, f"[observed.{name}]", path)
    allowed = (*QUANTITIES, "axis", "unit", "noise", "scatter")
    _known(table, allowed, f"key of [observed.{name}] in {path}")
    what = [key for key in QUANTITIES if key in table]
    noise = _number(table.get("noise", 0), "noise", path, 0.0)
    if len(what) != 1 or "unit" not in table or not noise > 0:
        raise FormatError(
            f"{path}: [observed.{name}] needs one of {', '.join(QUANTITIES)}, a unit "
            "and a positive noise (standard deviation of its measurement)."
        )
    axis = str(table.get("axis", "x"))
    axes = AXES if what[0] == "gyro" else (*AXES, *TURNS)
    if axis not in axes:
        raise UnknownNameError(f"axis of [observed.{name}]", axis, axes)
    channel = _channel(name, table["unit"], path)
    if channel.unit not in UNITS:
        raise FormatError(
            f"{path}: [observed.{name}] is in {channel.unit!r}; joints and places are "
            f"in {', '.join(UNITS)}."
        )
    if what[0] == "gyro" and channel.unit != "rad/s":
        raise FormatError(
            f"{path}: [observed.{name}] is in {channel.unit!r}; a gyro reads rad/s."
        )
    made = Seen(
        channel,
        what[0],
        str(table[what[0]]),
        axes.index(axis),
        noise,
        _number(table.get("scatter", noise), "scatter", path, 0.0),
    )
    unit = "rad" if made.turning else "m"
    if made.quantity in PLACES and channel.unit != unit:
        raise FormatError(
            f"{path}: [observed.{name}] is in {channel.unit!r}, and {axis} of a "
            f"{made.quantity} in {unit!r}; how it is turned is axis = "
            f"{', '.join(map(repr, TURNS))}."
        )
    return made


def _channel(name: str, unit: Any, path: Path) -> Channel:
    """A channel, which is in SI units.

    Raises:
        FormatError: it is in another one that is known.
    """
    unit, right = str(unit), si_unit(str(unit))
    if unit != right:
        raise FormatError(
            f"{path}: {name} is in {unit!r}; channels are in SI units. Give unit = "
            f'"{right}" here, and of its column in the log [log] "{name}" = '
            f'{{ column = "...", unit = "{unit}" }}.'
        )
    return Channel(name, unit)


def _mapping(table: Any, where: str, path: Path) -> Mapping[str, Any]:
    if not isinstance(table, dict):
        raise FormatError(f"{path}: {where} has to be a table.")
    return table


def _bounds(name: str, row: Any, path: Path) -> Mapping[str, float]:
    row = _mapping(row, f"bounds of {name}", path)
    _known(row, ("low", "high", "slack"), f"bound of {name} in {path}")
    return {
        key: _number(value, key, path, 0.0 if key == "slack" else -BEYOND)
        for key, value in row.items()
    }


def _number(
    value: Any, name: str, path: Path, low: float = -BEYOND, high: float = BEYOND
) -> float:
    """A number of the description.

    Raises:
        FormatError: it is none, or out of bounds.
    """
    if isinstance(value, bool) or not isinstance(value, int | float):
        raise FormatError(f"{path}: {name} = {value!r} is no number.")
    if not low <= value <= high:
        raise FormatError(
            f"{path}: {name} = {value!r} is not from {low:g} to {high:g}."
        )
    return float(value)


def _source(name: str, item: Any, path: Path) -> Source:
    if isinstance(item, str):
        return Source(item, "")
    table = _mapping(item, f"log column of {name}", path)
    unit = str(table.get("unit", ""))
    known = {unit for row in FACTORS.values() for unit in row}
    if "column" not in table or (unit and unit not in known):
        raise FormatError(
            f"{path}: {name} needs a column and a unit among "
            f"{', '.join(sorted(known))}."
        )
    scale = table.get("scale", 1.0)
    if not isinstance(scale, int | float) or not 0 < abs(scale) < math.inf:
        raise FormatError(
            f"{path}: the scale of {name} is {scale!r}; give a number that its column "
            "is multiplied by, -1 to turn its sign."
        )
    return Source(str(table["column"]), unit, float(scale))
