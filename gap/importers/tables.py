"""Logs as people have them, each read into one table: stamps and columns of numbers.

CSV, Parquet, NPZ, directories of these, PACE (`.pt`), SAGE, LeRobotDataset and MCAP.
What a format says of its columns (told or seen, which joint, which quantity) is kept;
units are left as they are.
"""

import re
from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from importlib import import_module
from pathlib import Path
from typing import Any

import numpy as np
from scipy.spatial.transform import Rotation

from bns.errors import FormatError
from bns.gap.importers import other_files
from bns.storage import reading

TIME, TRIAL, SENT = "time", "trial", "command_time"
"""columns that a log may have under these names, beside its channels"""

TOLD, SEEN = "told", "seen"
"""what a column may hold: a command, or a measurement"""

POSITION, SPEED, EFFORT = "position", "speed", "effort"
MOST = 1e20  # of numbers of any kind; stamps in nanoseconds are below
QUATERNION = r"(?i)(q|quat|quaternion|orientation|rot|rotation)[._]?$"
SAME = 1e-6  # [s] moments that are nearer are one

ENDS = ([".csv"], [".tsv"], [".txt"])
PACKED = ".gz"
TICKS = {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9}
SORT = (
    "Sort the rows by time, or number recordings that follow one another in a column "
    f"{TRIAL!r}."
)


@dataclass(frozen=True, eq=False)
class Column:
    """One column of a log.

    Attributes:
        name: by which a description's [log] finds it.
        values: its samples, shape ``(T,)``, NaN where there is none.
        role: `TOLD`, `SEEN` or "" (the format does not say).
        part: name of the joint, if the format says.
        quantity: `POSITION`, `SPEED`, `EFFORT` or "" (the format does not say).
    """

    name: str
    values: np.ndarray
    role: str = ""
    part: str = ""
    quantity: str = ""


@dataclass(frozen=True, eq=False)
class Table:
    """A log.

    Attributes:
        columns: all of the same length, in the order of the file.
        kind: of the file, in words.
        notes: what was left out or chosen on the way, one line each.
    """

    columns: tuple[Column, ...]
    kind: str
    notes: tuple[str, ...] = ()

    @property
    def names(self) -> tuple[str, ...]:
        """Names of all columns."""
        return tuple(column.name for column in self.columns)

    def __getitem__(self, name: str) -> np.ndarray:
        """Samples of a column.

        Raises:
            FormatError: there is none of that name.
        """
        for column in self.columns:
            if column.name == name:
                return column.values
        raise FormatError(
            f"the {self.kind} has no column {name!r}; it has {', '.join(self.names)}."
        )

    def __contains__(self, name: str) -> bool:
        return name in self.names


def reader(path: str | Path) -> Callable[[Path], Table] | None:
    """What reads a log; None if it is of no known kind."""
    path = Path(path)
    suffixes = [suffix.lower() for suffix in path.suffixes]
    name = ""
    if path.is_dir():
        if other_files.is_lerobot(path):
            name = "lerobot"
        elif other_files.is_sage(path):
            name = "sage"
        elif any(path.glob("*.mcap")):
            name = "ros2_mcap"
        elif other_files.tables_in(path):
            name = "directory_log"
    elif suffixes[-1:] in ([".pt"], [".pth"]):
        name = "pace"
    elif path.suffix.lower() in other_files.COLUMNAR:
        name = "array_log"
    elif suffixes[-1:] == [".mcap"]:
        name = "ros2_mcap"
    elif [end for end in suffixes if end != PACKED][-1:] in ENDS:
        name = "csv_log"
    return import_module(f"bns.gap.importers.{name}").read if name else None


def read(path: str | Path) -> Table:
    """The table in a log.

    Raises:
        FormatError: no such file, of no known kind, not to be read, or as `checked`.
        MissingDependencyError: a package that this kind needs.
    """
    path = Path(path)
    if not path.exists():
        raise FormatError(f"There is no log {path}.")
    if part := other_files.whole(path):
        home, what = part
        raise FormatError(f"{path} is a part of {what}: give its directory {home}.")
    found = reader(path)
    if found is None:
        raise FormatError(other_files.advice(path))
    return turned(checked(found(path), path))


def turned(table: Table) -> Table:
    """A log with roll, pitch and yaw [rad] beside each quaternion in it, four columns
    that end with w, x, y and z: "base_qw" gives "base_yaw"."""
    made, notes = [], []
    for column in table.columns:
        four = [column.name[:-1] + letter for letter in "xyzw"]
        stem = re.sub(QUATERNION, "", four[0][:-1])
        named = column.name == four[-1] and stem != four[0][:-1]
        if not named or not all(name in table for name in four):
            continue
        values = np.stack([table[name] for name in four], axis=1)
        good = np.isfinite(values).all(axis=1) & values.any(axis=1)
        angles = np.full((len(values), 3), np.nan)
        angles[good] = Rotation.from_quat(values[good]).as_euler("ZYX")
        names = [f"{stem}{turn}" for turn in ("yaw", "pitch", "roll")]
        if not {*names} & {*table.names}:
            pairs = zip(names, angles.T, strict=True)
            made += [Column(name, each, column.role) for name, each in pairs]
            notes.append(f"{', '.join(names)}: from {', '.join(four)}")
    return replace(table, columns=(*table.columns, *made), notes=(*table.notes, *notes))


def joined(
    times: np.ndarray,
    seen: Sequence[Column],
    sent: np.ndarray,
    told: Sequence[Column],
) -> tuple[np.ndarray, tuple[Column, ...]]:
    """Measurements and commands that have stamps of their own, in one table.

    A moment at which only a command was sent has no measurement (NaN); each command
    holds until the next. What was before the first command is left out.

    Args:
        times: of the measurements [s], shape ``(T,)``, increasing.
        seen: their columns, each ``(T,)``.
        sent: when the commands were sent [s], shape ``(M,)``, increasing.
        told: their columns, each ``(M,)``.

    Returns:
        the moments [s], increasing, from the first with a command on; told and seen
        columns.
    """
    near = np.searchsorted(times, sent - SAME)
    own = np.ones(len(sent), bool)
    inside = near < len(times)
    own[inside] = np.abs(times[near[inside]] - sent[inside]) > SAME
    moments = np.sort(np.concatenate([times, sent[own]]), kind="stable")
    last = np.searchsorted(sent, moments + SAME, side="right") - 1
    kept = last >= 0
    at = np.searchsorted(moments, times)
    made = [_replaced(column, column.values[last[kept]]) for column in told]
    for column in seen:
        values = np.full(len(moments), np.nan)
        values[at] = column.values
        made.append(_replaced(column, values[kept]))
    return moments[kept], tuple(made)


def _replaced(column: Column, values: np.ndarray) -> Column:
    return Column(column.name, values, column.role, column.part, column.quantity)


def stamped(
    times: np.ndarray,
    columns: Sequence[Column],
    kind: str,
    trial: np.ndarray | None,
    notes: Sequence[str] = (),
) -> Table:
    """A table of a format that has names for nothing but joints.

    Args:
        times: of the samples [s].
        columns: of commands and measurements.
        kind: of the file, in words.
        trial: number of the trial of each sample; None = one.
        notes: see `Table`.
    """
    first = [Column(TIME, np.asarray(times, float))]
    if trial is not None:
        first.append(Column(TRIAL, np.asarray(trial, float)))
    return Table((*first, *columns), kind, tuple(notes))


def forward(
    times: np.ndarray, where: object, what: str = TIME, todo: str = SORT
) -> None:
    """Stop at stamps that go backwards.

    Args:
        times: stamps ``(T,)``, in any unit.
        where: of the file, for the message.
        what: name of the column or topic, for the message.
        todo: what to do about it, a sentence.

    Raises:
        FormatError: they do.
    """
    fell = np.flatnonzero(np.diff(times) < 0)
    if len(fell):
        row = int(fell[0])
        raise FormatError(
            f"{where}: {what} goes backwards, from {times[row]:.10g} in row {row} to "
            f"{times[row + 1]:.10g} in row {row + 1}. {todo}"
        )


def checked(table: Table, path: Path) -> Table:
    """The table, if its columns are what can have been recorded.

    Raises:
        FormatError: no rows, columns of different lengths, a name twice, infinity, or a
            number beyond `MOST` (`numbers.BEYOND` in what was told or seen).
    """
    rows = {column.values.shape for column in table.columns}
    if len(rows) != 1 or not min(rows):
        raise FormatError(f"{path} has no rows, or columns of different lengths.")
    for column in table.columns:
        if table.names.count(column.name) > 1:
            raise FormatError(f"{path}: the column {column.name!r} is there twice.")
        most = reading.BEYOND if column.role else MOST
        largest = float(np.nanmax(np.abs(column.values), initial=0.0))
        if largest > most:
            raise FormatError(
                f"{path}: the column {column.name!r} holds {largest:.3g}; {most:g} is "
                "the most that is read."
            )
    return table


def moments(columns: Mapping[str, Any]) -> dict[str, np.ndarray]:
    """Those of some columns that are moments, as seconds since the first of all.

    Args:
        columns: name -> column of Arrow, T rows.

    Returns:
        name -> seconds, ``(T,)``, NaN in cells that are empty.
    """
    from pyarrow import types

    moments = {n: c for n, c in columns.items() if types.is_timestamp(c.type)}
    whole = {name: column.cast("int64") for name, column in moments.items()}
    ticks = {name: TICKS[column.type.unit] for name, column in moments.items()}
    filled = {n: c.drop_null().to_numpy() for n, c in whole.items() if len(c)}
    firsts = {n: int(values.min()) for n, values in filled.items() if len(values)}
    zero = min((first * ticks[n] for n, first in firsts.items()), default=0.0)
    made = {}
    for name, column in whole.items():
        first = firsts.get(name, 0)  # whole numbers keep the fractions of a second
        later = (column.fill_null(first).to_numpy() - first) * ticks[name]
        values = later + (first * ticks[name] - zero)
        made[name] = np.where(column.is_null().to_numpy(), np.nan, values)
    return made


def named(names: Sequence[str], count: int) -> list[str]:
    """Names of a format's entries, or their numbers where it gives none."""
    listed = list(names)
    if len(listed) == count:
        return [str(name) for name in listed]
    return [str(number) for number in range(count)]
