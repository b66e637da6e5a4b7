"""Logs from elsewhere as trials: CSV and MCAP, columns mapped to channels.

Where the commanded wheel speeds are given each stretch of equal ones becomes a command.
Times count from the start of each trial, headings are made continuous, empty or NaN
poses are lost samples. What comes out can be written with
`bns.worlds.data.dataset.write`.

A map says which column of the log holds which channel, and in which unit it is. In a
TOML file:

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
from dataclasses import dataclass, replace
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.storage import reading, tables
from bns.worlds.data import dataset_checks as checks
from bns.worlds.data.mcap_log import STAMPS
from bns.worlds.data.units import FACTORS
from bns.worlds.trial import POSE, WHEEL_CHANNELS, Channel, Commands, Trial

TIMES = ("time", "command_time")
UNITS = {**dict.fromkeys(TIMES, "s"), **checks.UNITS}
SPEEDS = tuple(channel.name for channel in WHEEL_CHANNELS)


class Source(NamedTuple):
    """Where a channel is found: a column or topic field, its unit, and what its values
    are multiplied by besides (-1 turns their sign)."""

    column: str
    unit: str
    scale: float = 1.0


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
        robot, columns, units = read_map(path)
        return cls.of(columns, units, "khepera3" if robot is None else robot)

    @property
    def observed(self) -> tuple[Channel, ...]:
        """The observed channels in SI, the pose first."""
        known = (*POSE, *SPEEDS, *TIMES, "trial")
        other = [name for name in self.columns if name not in known]
        return tuple(
            Channel(name, UNITS.get(name, self.columns[name].unit))
            for name in (*POSE, *other)
        )


def read_map(path: str | Path) -> tuple[str | None, dict[str, str], dict[str, str]]:
    """What a TOML file says of a log, see the module's docstring.

    Returns:
        name of the robot, None where none is said; column by channel; unit by channel,
        where one is said.

    Raises:
        FormatError: no such file, not TOML, no table `columns`, or what is no column.
        UnknownNameError: a key that there is not.
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
    robot = str(given["robot"]) if "robot" in given else None
    return robot, columns, units


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


MOMENTS = "command_moments"
"""condition of a trial: "sampled" where commands are only known to begin by a sample"""

CLOCK = 1e-6  # s; nearer to a sample a command begins with it


def from_csv(
    path: str | Path,
    columns: Mapping[str, str] | ColumnMap | str | Path,
    *,
    units: Mapping[str, str] | None = None,
    robot: str = "khepera3",
    delimiter: str = ",",
) -> list[Trial]:
    """Trials from a table of samples, one row each, with a line of column names.

    Args:
        path: of the CSV file.
        columns: which column holds which channel; a mapping, a `ColumnMap` or a TOML
            file of one.
        units: of the channels that are not in SI (with a mapping only).
        robot: name of the robot model (with a mapping only).
        delimiter: between columns.

    Raises:
        FormatError: no such file, no table, a column missing or not of numbers, time
            going backwards.
        BnsError: an unknown channel or unit.
    """
    found = _map(columns, units, robot)
    wanted = [source.column for source in found.columns.values()]
    table = tables.read_csv(path, wanted, delimiter=delimiter)
    named = {name: table[source.column] for name, source in found.columns.items()}
    return trials(named, found, where=str(path))


def from_mcap(
    path: str | Path,
    columns: Mapping[str, str] | ColumnMap | str | Path,
    *,
    units: Mapping[str, str] | None = None,
    robot: str = "khepera3",
) -> list[Trial]:
    """Trials from an MCAP log of JSON messages, or ROS 2 ones.

    A column is written ``/topic:field``, with dots for fields in fields. The topic of
    `x` gives the samples; of other topics the last message before each holds. The
    column of `time` may be ``log_time`` or ``publish_time`` (unit ns); the stamps of
    the speeds' messages then say when they were sent.

    Args:
        path: of the MCAP file.
        columns, units, robot: as in `from_csv`.

    Raises:
        MissingDependencyError: the package `mcap` is not installed, or
            `mcap-ros2-support` for a log of ROS 2 messages.
        FormatError: no such file, no MCAP, a topic or field missing.
        BnsError: an unknown channel or unit.
    """
    from bns.worlds.data import mcap_log

    found = _map(columns, units, robot)
    sources = {name: source.column for name, source in found.columns.items()}
    stamped = SPEEDS[0] if _told_apart(found) else ""
    named = mcap_log.samples(Path(path), sources, clock="x", stamped=stamped)
    if stamped:
        clock = Source(sources["time"], found.columns["time"].unit)
        found = replace(found, columns={**found.columns, "command_time": clock})
    return trials(named, found, where=str(path))


def _told_apart(columns: ColumnMap) -> bool:
    """Whether a log's own stamps say when the speeds were sent."""
    own = columns.columns["time"].column in STAMPS
    return (
        own and SPEEDS[0] in columns.columns and "command_time" not in columns.columns
    )


def _map(
    columns: Mapping[str, str] | ColumnMap | str | Path,
    units: Mapping[str, str] | None,
    robot: str,
) -> ColumnMap:
    if isinstance(columns, ColumnMap):
        return columns
    if isinstance(columns, str | Path):
        return ColumnMap.read(columns)
    return ColumnMap.of(columns, units, robot)


def trials(
    named: Mapping[str, np.ndarray], columns: ColumnMap, *, where: str
) -> list[Trial]:
    """Trials from arrays by channel, in the units of the map.

    Args:
        named: samples by channel, each ``(T,)``, in order of time.
        columns: the map.
        where: what to name in errors.

    Raises:
        FormatError: no sample, or a trial that is not valid.
    """
    si = {
        name: np.asarray(values, float) * factor(name, columns.columns[name].unit)
        for name, values in named.items()
    }
    if not len(si["time"]):
        raise FormatError(f"{where}: there is no sample in it.")
    label = si.get("trial", np.zeros(len(si["time"])))
    edges = np.flatnonzero(np.diff(label) != 0) + 1
    return [
        _trial({key: si[key][rows] for key in si}, columns, f"{where}: trial {index}")
        for index, rows in enumerate(np.split(np.arange(len(label)), edges))
    ]


def _trial(si: Mapping[str, np.ndarray], columns: ColumnMap, where: str) -> Trial:
    times = si["time"] - si["time"][0]
    wrong = ~np.isfinite(times) | (np.diff(times, prepend=times[0]) < 0)
    if wrong.any():
        row = int(np.argmax(wrong))
        raise FormatError(
            f"{where}: time is missing or goes backwards at sample {row}; sort the "
            "samples by time."
        )
    pose = np.stack([si[name] for name in POSE], axis=1)
    pose[~np.isfinite(pose).all(axis=1)] = np.nan
    seen = np.isfinite(pose[:, 2])
    pose[seen, 2] = np.unwrap(pose[seen, 2])
    other = [si[channel.name] for channel in columns.observed[len(POSE) :]]
    commands, boundaries = _commands(si, times)
    observed = np.column_stack([pose, *other])
    exact = "command_time" in si or not len(commands)
    if "command_time" in si and len(commands):
        sent = si["command_time"] - si["time"][0]
        times, observed, boundaries = _sent(times, observed, boundaries, sent, where)
        commands = replace(commands, durations=np.diff(times[boundaries]))
    trial = Trial(
        commands=commands,
        times=times,
        observed=observed,
        boundaries=boundaries,
        channels=columns.observed,
        robot=columns.robot,
        world="imported",
        conditions={} if exact else {MOMENTS: "sampled"},
    )
    checks.valid(trial, where)
    return trial


def _commands(
    si: Mapping[str, np.ndarray], times: np.ndarray
) -> tuple[Commands, np.ndarray]:
    """Stretches of equal speeds, and the samples between which they hold."""
    none = Commands(np.zeros((0, 2)), np.zeros(0)), np.zeros(1, int)
    if SPEEDS[0] not in si or len(times) < 2:
        return none
    speeds = np.stack([si[name] for name in SPEEDS], axis=1)
    speeds = _held(speeds)
    change = (np.diff(speeds[:-1], axis=0) != 0).any(axis=1)
    begins = np.concatenate([[0], np.flatnonzero(change) + 1])
    begins = begins[np.diff(times[np.append(begins, len(times) - 1)]) > 0]
    if not len(begins):
        return none
    bounds = np.append(begins, len(times) - 1)
    return Commands(speeds[begins], np.diff(times[bounds])), bounds


def _sent(
    times: np.ndarray,
    observed: np.ndarray,
    boundaries: np.ndarray,
    sent: np.ndarray,
    where: str,
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Samples with those added, without a pose, at which commands began.

    Raises:
        FormatError: a command sent after the sample that has it, or before the one
            before.
    """
    rows = boundaries[1:-1]
    begins, first = sent[rows], times[rows - 1]
    wrong = np.flatnonzero(
        ~((begins > first - CLOCK) & (begins <= times[rows] + CLOCK))
    )
    if len(wrong):
        row = rows[wrong[0]]
        raise FormatError(
            f"{where}: command_time is {sent[row]:.4g} s where the sample of "
            f"{times[row]:.4g} s is the first with the command and the one before is "
            f"of {times[row - 1]:.4g} s; it has to lie between them."
        )
    late = times[rows] - begins > CLOCK
    begins = np.maximum(begins, first + CLOCK)
    at = rows[late]
    new = observed[at - 1]  # a copy
    new[:, : len(POSE)] = np.nan
    grown = np.insert(times, at, begins[late])
    held = np.insert(observed, at, new, axis=0)
    before = np.concatenate([[0], np.cumsum(late)])
    inner = rows + before[:-1]
    ends = [[0], inner, [len(grown) - 1]]
    return grown, held, np.concatenate(ends)


def _held(speeds: np.ndarray) -> np.ndarray:
    """Missing speeds are the last ones given; before the first the robot stands."""
    given = np.isfinite(speeds).all(axis=1)
    last = np.maximum.accumulate(np.where(given, np.arange(len(speeds)), -1))
    return np.where(last[:, None] >= 0, speeds[last], 0.0)
