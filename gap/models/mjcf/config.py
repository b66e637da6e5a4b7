"""The TOML file that describes a model of one's own; see docs/gap_your_robot.md."""

import math
from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

from bns.errors import BnsError, FormatError
from bns.gap.importers.tables import SENT, TIME, TRIAL
from bns.gap.models.mjcf.described import Seen, Told, known, mapping, number
from bns.storage import reading
from bns.storage.reading import BEYOND
from bns.worlds.data.importing import Source, read_map
from bns.worlds.data.units import FACTORS
from bns.worlds.effects import parts

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
MARKS = (TIME, TRIAL, SENT)  # columns of a log beside its channels
WINDOW = 0.1  # [s] between two samples that are compared


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
        known(given, KEYS, f"key of {path}")
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
        known(start, START, f"key of [start] in {path}")
        bounds = _table(given, "bounds", path)
        effects = _table(given, "effects", path) if "effects" in given else None
        return cls(
            name=str(given["name"]),
            model=path.parent / str(given["model"]),
            told=tuple(Told.read(n, t, path) for n, t in given["commands"].items()),
            seen=tuple(Seen.read(n, t, path) for n, t in given["observed"].items()),
            held=_names(given.get("held", ())),
            keyframe=str(start.get("keyframe", "")),
            recorded=bool(start.get("recorded", False)),
            settle=number(start.get("settle", 0.0), "settle", path, 0.0, 60.0),
            cut=_cut(start, path),
            window=number(given.get("window", WINDOW), "window", path, 1e-3, 60.0),
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
        known(columns, (*MARKS, *told, *seen), f"channel in {path}")
        named = {
            name: _source(name, {"column": column, "unit": units.get(name, "")}, path)
            for name, column in columns.items()
        }
        return replace(self, log={**self.log, **named})


def _table(given: Mapping[str, Any], key: str, path: Path) -> Mapping[str, Any]:
    table = given.get(key, {})
    if not isinstance(table, dict):
        raise FormatError(f"{path}: {key!r} has to be a table, [{key}].")
    return table


def _names(parts: Any) -> tuple[str, ...]:
    listed = parts if isinstance(parts, list | tuple) else (parts,)
    return tuple(map(str, listed))


def _cut(start: Mapping[str, Any], path: Path) -> float:
    cut = number(start.get("cut", 0.0), "cut", path)
    if cut < 0 or (cut and not start.get("recorded")):
        raise BnsError(
            f"{path}: [start] cut is a positive length in seconds, and needs "
            "recorded = true: pieces begin where the robot was."
        )
    return cut


def _bounds(name: str, row: Any, path: Path) -> Mapping[str, float]:
    row = mapping(row, f"bounds of {name}", path)
    known(row, ("low", "high", "slack"), f"bound of {name} in {path}")
    return {
        key: number(value, key, path, 0.0 if key == "slack" else -BEYOND)
        for key, value in row.items()
    }


def _source(name: str, item: Any, path: Path) -> Source:
    if isinstance(item, str):
        return Source(item, "")
    table = mapping(item, f"log column of {name}", path)
    unit = str(table.get("unit", ""))
    units = {unit for row in FACTORS.values() for unit in row}
    if "column" not in table or (unit and unit not in units):
        raise FormatError(
            f"{path}: {name} needs a column and a unit among "
            f"{', '.join(sorted(units))}."
        )
    scale = table.get("scale", 1.0)
    if not isinstance(scale, int | float) or not 0 < abs(scale) < math.inf:
        raise FormatError(
            f"{path}: the scale of {name} is {scale!r}; give a number that its column "
            "is multiplied by, -1 to turn its sign."
        )
    return Source(str(table["column"]), unit, float(scale))
