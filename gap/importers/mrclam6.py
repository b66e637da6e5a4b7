"""Differential-drive robots told speeds, seen by motion capture: the form of MRCLAM.

Leung, Halpern, Barfoot and Liu, "The UTIAS multi-robot cooperative localization and
mapping dataset", IJRR 30(8), 2011. Per robot a text table `RobotN_Odometry.dat` (time
[s], forward speed [m/s] and turning rate [rad/s] as commanded) and
`RobotN_Groundtruth.dat` (time [s], x, y [m], heading [rad]), as they are or gzipped;
lines that start with # are remarks. Times are of one clock, in seconds since 1970.

The recording is cut into trials of equal length; stretches of equal commands become
one. Time counts from the start of each trial, headings are continuous. A trial in which
the cameras lost the robot for longer than `GAP` is left out.
"""

from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.storage import reading
from bns.worlds.data import dataset_checks as checks
from bns.worlds.trial import Channel, Commands, Trial

CHANNELS = (Channel("forward_speed", "m/s"), Channel("turning_rate", "rad/s"))
ODOMETRY, TRUTH = "Robot{}_Odometry.dat", "Robot{}_Groundtruth.dat"
MOST = 256 << 20  # [bytes] of a table, unpacked
GAP = 0.5  # [s] assumed: longer without a pose, motion can not be compared
SHORTEST = 0.005  # [s] commands that follow sooner are merged with the one before


def robots(directory: str | Path) -> tuple[int, ...]:
    """Numbers of the robots that a directory has recordings of."""
    found = Path(directory).glob("Robot*_Odometry.dat*")
    names = (file.name.removeprefix("Robot").partition("_")[0] for file in found)
    return tuple(sorted({int(name) for name in names if name.isdigit()}))


def read(directory: str | Path, robot: int, *, seconds: float = 60.0) -> list[Trial]:
    """Trials of one robot.

    Args:
        directory: where the tables lie.
        robot: its number.
        seconds: length of a trial.

    Raises:
        FormatError: a table is missing, not of numbers, or its time goes backwards.
    """
    told = _table(Path(directory), ODOMETRY.format(robot), 3)
    seen = _table(Path(directory), TRUTH.format(robot), 4)
    start, end = max(told[0, 0], seen[0, 0]), min(told[-1, 0], seen[-1, 0])
    seen[:, 3] = np.unwrap(seen[:, 3])
    if not 0 <= end - start < checks.LONGEST:
        raise FormatError(f"{directory}: robot {robot}'s tables share no time.")
    trials = []
    for number in range(int((end - start) // seconds)):
        begin = start + number * seconds
        made = _trial(told, seen, begin, begin + seconds)
        if made is not None:
            checks.plausible(made, f"{directory}: robot {robot}, part {number}")
            about = {"robot_number": robot, "part": number, "tracked": "markers"}
            trials.append(made.replace(conditions=about))
    return trials


def _trial(
    told: np.ndarray, seen: np.ndarray, begin: float, end: float
) -> Trial | None:
    inside = (seen[:, 0] >= begin) & (seen[:, 0] < end)
    poses = seen[inside]
    if len(poses) < 2 or np.diff(poses[:, 0], prepend=begin, append=end).max() > GAP:
        return None
    times = poses[:, 0] - begin
    first = np.searchsorted(told[:, 0], begin, side="right") - 1
    rows = told[max(first, 0) : np.searchsorted(told[:, 0], end)]
    starts = np.maximum(rows[:, 0] - begin, 0.0)
    changed = np.any(np.diff(rows[:, 1:], axis=0) != 0, axis=1)
    keep = np.concatenate([[True], changed])
    starts, values = starts[keep], rows[keep, 1:]
    lasting = np.diff(starts, append=end - begin) >= SHORTEST
    starts, values = starts[lasting], values[lasting]
    starts[0] = 0.0
    edges = np.append(starts, end - begin)
    marks = np.clip(np.searchsorted(times, edges), 0, len(times) - 1)
    return Trial(
        commands=Commands(values, np.diff(edges), CHANNELS),
        times=times,
        observed=poses[:, 1:],
        boundaries=marks,
        robot="irobot_create",
        world="recording",
    )


def _table(directory: Path, name: str, columns: int) -> np.ndarray:
    plain, packed = directory / name, directory / f"{name}.gz"
    if not (plain.exists() or packed.exists()):
        raise FormatError(
            f"{directory} holds neither {name} nor {name}.gz; robots there: "
            f"{', '.join(map(str, robots(directory))) or 'none'}."
        )
    file = plain if plain.exists() else packed
    load = reading.read_packed if file is packed else reading.read_bytes
    text = load(file, most=MOST)
    try:
        rows = [line.split() for line in text.decode().splitlines() if _data(line)]
        table = np.array(rows, dtype=float)
    except ValueError as error:
        raise FormatError(f"{file} is no table of numbers ({error}).") from None
    if table.ndim != 2 or table.shape[1] != columns or not np.isfinite(table).all():
        raise FormatError(f"{file} needs {columns} finite numbers a line.")
    if (np.diff(table[:, 0]) < 0).any():
        at = int(np.argmin(np.diff(table[:, 0]))) + 1
        raise FormatError(f"{file}: time goes backwards at row {at + 1}.")
    return table


def _data(line: str) -> bool:
    return bool(line.strip()) and not line.lstrip().startswith("#")
