"""SAGE: a directory with a motion of a robot, commands and states in two CSV files.

`control.csv` (timestamp, positions) and `state_motor.csv` (timestamp, positions,
velocities, torques) hold lists, one entry a joint in the order of `joint_list.txt`.
Stamps are microseconds on the robot, seconds in its simulation; `event.csv`, where
there is one, says when the motion began (MOTION_START) and ended (DISABLE).

Format: https://github.com/isaac-sim2real/sage
"""

import csv
import io
import re
from collections.abc import Iterable
from pathlib import Path

import msgspec
import numpy as np

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.storage import reading

COMMANDS, STATES, JOINTS = "control.csv", "state_motor.csv", "joint_list.txt"
EVENTS, BEGIN, END = "event.csv", "MOTION_START", "DISABLE"
QUANTITIES = {
    "positions": tables.POSITION,
    "velocities": tables.SPEED,
    "torques": tables.EFFORT,
}
SECONDS = 1000.0  # [s] stamps beyond are microseconds
MICRO = 1e-6
NAN = re.compile(r"\bnan\b", re.IGNORECASE)
Cell = list[float | None]


def read(path: Path) -> Table:
    """The table of a motion; its columns are named as `positions.JOINT`.

    Raises:
        FormatError: a file missing, or one that does not fit the others.
    """
    sent, told = _vectors(path / COMMANDS, ("positions",), tables.TOLD)
    times, seen = _vectors(path / STATES, tuple(QUANTITIES), tables.SEEN)
    unit = MICRO if max(times[-1], sent[-1]) > SECONDS else 1.0
    begin, end = _motion(path / EVENTS)
    kept = (times >= begin) & (times <= end)
    if not kept.any():
        raise FormatError(f"{path}: no state lies between {BEGIN} and {END}.")
    seen = [Column(c.name, c.values[kept], *_about(c)) for c in seen]
    moments, columns = tables.joined(times[kept] * unit, seen, sent * unit, told)
    inside = (moments >= times[kept][0] * unit) & (moments <= times[kept][-1] * unit)
    columns = tuple(Column(c.name, c.values[inside], *_about(c)) for c in columns)
    return tables.stamped(moments[inside], columns, "SAGE motion", None)


def _about(column: Column) -> tuple[str, str, str]:
    return column.role, column.part, column.quantity


def _vectors(
    path: Path, wanted: tuple[str, ...], role: str
) -> tuple[np.ndarray, list[Column]]:
    """Stamps and columns of a file whose cells are lists."""
    rows = _rows(path)
    present = [name for name in wanted if name in rows[0]]
    if "timestamp" not in rows[0] or "positions" not in present:
        raise FormatError(f"{path} needs the columns timestamp and positions.")
    try:
        times = np.array([float(row["timestamp"]) for row in rows])
        values = {
            name: np.array([_cell(row[name]) for row in rows], dtype=float)
            for name in present
        }
    except (*reading.UNREADABLE, msgspec.MsgspecError) as error:
        raise FormatError(f"{path}: a cell is no list of numbers ({error}).") from None
    if not np.isfinite(times).all():
        raise FormatError(f"{path}: a timestamp is NaN or infinity.")
    tables.forward(times, path, "timestamp", "Sort the rows by timestamp.")
    joints = _joints(path.parent / JOINTS, values["positions"], path)
    prefix = "control." if role == tables.TOLD else ""
    return times, [
        Column(f"{prefix}{name}.{joint}", table[:, at], role, joint, QUANTITIES[name])
        for name, table in values.items()
        for at, joint in enumerate(joints)
    ]


def _cell(text: str) -> Cell:
    """The numbers in a cell; what is not a number is None.

    Raises:
        msgspec.MsgspecError: it holds something else.
        TypeError: the row has no such cell.
    """
    return msgspec.json.decode(NAN.sub("null", text), type=Cell)


def _rows(path: Path) -> list[dict[str, str]]:
    text = reading.read_text(path, most=reading.DATA)
    try:
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
    except (csv.Error, ValueError) as error:
        raise FormatError(f"{path} cannot be read as CSV ({error}).") from None
    if not rows:
        raise FormatError(f"{path} has no rows.")
    return rows


def _joints(path: Path, table: np.ndarray, where: Path) -> list[str]:
    if not path.exists():
        raise FormatError(f"{where} needs {path.name} beside it, with the joints.")
    lines = reading.read_text(path).splitlines()
    names = [line.strip() for line in lines if line.strip()]
    if table.ndim != 2 or table.shape[1] != len(names):
        width = table.shape[1] if table.ndim == 2 else 0
        raise FormatError(
            f"{where} has {width} positions a row, {path.name} names {len(names)} "
            "joints; they have to agree."
        )
    return names


def _motion(path: Path) -> tuple[float, float]:
    """First and last stamp of the motion, in the file's own unit."""
    if not path.exists():
        return -np.inf, np.inf
    begin, end = -np.inf, np.inf
    for row in _rows(path):
        said = {str(cell).strip() for cell in _cells(row.values())}
        try:
            if BEGIN in said:
                begin = float(row["timestamp"])
            elif END in said:
                end = float(row["timestamp"])
        except (KeyError, TypeError, ValueError):
            raise FormatError(f"{path}: an event has no timestamp.") from None
    return begin, end


def _cells(values: Iterable) -> Iterable[str]:
    for value in values:
        yield from value if isinstance(value, list) else (value,)
