"""Which column of a foreign log holds which channel, and in which unit it is.

In a TOML file:

    robot = "khepera3"

    [columns]
    time = {column = "stamp", unit = "ms"}
    x = {column = "px", unit = "mm"}
    y = {column = "py", unit = "mm"}
    yaw = {column = "heading", unit = "deg"}
    left_speed = "vl"          # SI units need not be said
    right_speed = "vr"
    trial = "run"              # optional: a new value begins a new trial
    command_time = "sent"      # optional: when the speeds in the row were sent

Needed are time, x, y and yaw. Without `command_time` speeds are taken to change with
the first sample that has the new ones: at 20 samples a second that is up to 50 ms late,
which a diagnosis takes for a gap. Other names become further observed channels; give
their unit.
"""

from collections.abc import Mapping
from dataclasses import dataclass
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.storage import reading
from bns.worlds.data import dataset_checks as checks
from bns.worlds.trial import POSE, WHEEL_CHANNELS, Channel

SPEED_UNIT = 1e-3 / 144.01  # [m/s] Khepera III manual 2.2, p. 14 (firmware < 3)
FACTORS = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "rad": {"rad": 1.0, "deg": np.pi / 180, "turn": 2 * np.pi},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "khepera-speed": SPEED_UNIT},
}
TIMES = ("time", "command_time")
UNITS = {**dict.fromkeys(TIMES, "s"), **checks.UNITS}
SPEEDS = tuple(channel.name for channel in WHEEL_CHANNELS)


class Source(NamedTuple):
    """Where a channel is found: a column or topic field, and its unit."""

    column: str
    unit: str


@dataclass(frozen=True)
class ColumnMap:
    """Which column holds which channel.

    Attributes:
        columns: by channel; beside observed ones `time`, `left_speed`, `right_speed`,
            `command_time` and `trial`.
        robot: name of the robot model.
    """

    columns: Mapping[str, Source]
    robot: str = "khepera3"

    @classmethod
    def of(
        cls,
        columns: Mapping[str, str],
        units: Mapping[str, str] | None = None,
        robot: str = "khepera3",
    ) -> "ColumnMap":
        """A map from names of columns, and units where they are not SI.

        Args:
            columns: name of the column of each channel; time and pose are needed.
            units: of channels that are not in SI units.
            robot: that the recording is of.

        Raises:
            BnsError: a channel missing, or a unit that is missing or unknown.
            UnknownNameError: a unit of a channel that has no column.
        """
        units = dict(units or {})
        for name in units:
            if name not in columns:
                raise UnknownNameError("channel with a unit", name, columns)
        for name in ("time", *POSE):
            if name not in columns:
                raise BnsError(
                    f"The column map lacks {name!r}; needed are time, "
                    f"{', '.join(POSE)}."
                )
        if len(set(SPEEDS) & set(columns)) == 1:
            raise BnsError(f"Give a column for both {' and '.join(SPEEDS)}, or none.")
        sources = {
            name: Source(str(column), _unit(name, units.get(name)))
            for name, column in columns.items()
        }
        return cls(sources, robot)

    @classmethod
    def read(cls, path: str | Path) -> "ColumnMap":
        """The map in a TOML file, see the module's docstring.

        Raises:
            FormatError: no such file, not TOML, or no table `columns`.
            BnsError: as `of`.
        """
        given = reading.read_toml(path)
        for key in given:
            if key not in ("robot", "columns"):
                raise UnknownNameError("key of a column map", key, ("robot", "columns"))
        table = given.get("columns")
        if not isinstance(table, dict):
            raise FormatError(f"Column map {path} has no table [columns].")
        columns, units = {}, {}
        for name, item in table.items():
            entry = {"column": item} if isinstance(item, str) else item
            if not isinstance(entry, dict) or not {"column"} <= set(entry) <= {
                "column",
                "unit",
            }:
                raise FormatError(
                    f"Column map {path}: {name} = {item!r}; write "
                    f'{name} = "column" or {{column = "...", unit = "..."}}.'
                )
            columns[name] = str(entry["column"])
            if "unit" in entry:
                units[name] = str(entry["unit"])
        return cls.of(columns, units, str(given.get("robot", "khepera3")))

    @property
    def observed(self) -> tuple[Channel, ...]:
        """The observed channels in SI, the pose first."""
        known = (*POSE, *SPEEDS, *TIMES, "trial")
        other = [name for name in self.columns if name not in known]
        return tuple(
            Channel(name, UNITS.get(name, self.columns[name].unit))
            for name in (*POSE, *other)
        )


def factor(name: str, unit: str) -> float:
    """What turns a channel's samples into SI; 1 for channels without a known unit."""
    return FACTORS[UNITS[name]][unit] if name in UNITS else 1.0


def _unit(name: str, given: str | None) -> str:
    """The unit of a channel, if it is one that can be converted."""
    if name == "trial":
        return ""
    if name not in UNITS:
        if given is None:
            raise BnsError(f"Channel {name!r} needs its unit; give one.")
        return given
    unit = UNITS[name]
    if given is not None and given not in FACTORS[unit]:
        raise UnknownNameError(f"unit of {name}", given, FACTORS[unit])
    return given or unit
