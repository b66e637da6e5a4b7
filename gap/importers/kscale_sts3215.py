"""Runs of a Feetech servo on a pendulum in the form of K-Scale's recordings.

A directory with `index.csv` (one row of metadata per run: file, mass [kg],
length [m], kp, trajectory, vin [V]) and `runs.npz` (one array per run under the same
name, columns named by the entry `_columns`).

Known faults, and what is done: the lever's own mass is missing from the metadata (36 g
at 0.10 m, 50 g at 0.15 m, added as `arm_mass`); the metadata's voltage is not that of
the supply (the median of the servo's own reading is `voltage`, the other is kept as
`voltage_told`); `load` is always zero and left out, as are `torque` and `current`,
whose units are unclear; lost packets read as -pi for one sample and are mended
(`lost_samples` counts them); angles come in steps of a 12-bit encoder (`quantisation`).
"""

import csv
import io
from collections.abc import Callable, Mapping
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import servo
from bns.storage import arrays, reading
from bns.worlds.trial import Channel, Trial

INDEX, RUNS, COLUMNS = "index.csv", "runs.npz", "_columns"
CHANNELS = (
    Channel("angle", "rad"),
    Channel("speed", "rad/s"),
    Channel("voltage", "V"),
    Channel("temperature", "degC"),
)
SOURCES = {
    "time": "timestamp",
    "angle": "position",
    "speed": "speed",
    "goal": "goal_position",
    "torque_on": "torque_enable",
    "voltage": "input_volts",
    "temperature": "temp",
}
ARM_MASSES = {0.10: 0.036, 0.15: 0.050}  # [kg] by lever [m]; told with the recordings
QUANTISATION = 2 * np.pi / 4096  # [rad] 12-bit encoder
METADATA = ("file", "mass", "length", "kp", "trajectory", "vin")


def read(
    directory: str | Path, *, wanted: Callable[[Mapping[str, str]], bool] | None = None
) -> list[Trial]:
    """The runs of a directory, in the order of its index.

    Conditions of each trial: run, mass [kg], lever [m], arm_mass [kg], gain (firmware
    units), voltage and voltage_told [V], quantisation [rad], trajectory, repeat (number
    among the runs of the same mass, lever, gain and trajectory), lost_samples.

    Args:
        directory: where the files lie.
        wanted: which rows of the index to read; None = all.

    Raises:
        FormatError: a file, a column or a run is missing, or not of numbers.
    """
    home = servo.directory(directory, INDEX, RUNS)
    rows = _index(home / INDEX)
    repeats: dict[tuple, int] = {}
    trials = []
    runs = arrays.read_npz(home / RUNS)
    if COLUMNS not in runs:
        raise FormatError(f"{home / RUNS} names no columns (entry {COLUMNS!r}).")
    columns = [str(name) for name in np.atleast_1d(runs[COLUMNS])]
    for name in SOURCES.values():
        if columns.count(name) != 1:
            raise FormatError(f"{home / RUNS} has no column {name!r}, or two of them.")
    for row in rows:
        cell = tuple(row[key] for key in ("mass", "length", "kp", "trajectory"))
        repeat = repeats[cell] = repeats.get(cell, -1) + 1
        if wanted is None or wanted(row):
            table = runs.get(row["file"], np.zeros(0))
            if table.shape[1:] != (len(columns),) or table.dtype.kind not in "biuf":
                raise FormatError(
                    f"{home / RUNS} has no run {row['file']!r} of {len(columns)} "
                    "columns of numbers."
                )
            trials.append(_trial(row, repeat, table.astype(np.float64), columns))
    return trials


def _index(path: Path) -> list[dict[str, str]]:
    text = reading.read_text(path)
    try:
        rows = list(csv.DictReader(io.StringIO(text, newline="")))
    except (csv.Error, ValueError) as error:
        raise FormatError(f"{path} cannot be read as CSV: {error}.") from error
    for key in METADATA:
        if not rows or any(row.get(key) is None for row in rows):
            raise FormatError(f"{path} has no rows with a column {key!r}.")
    return rows


def _trial(
    row: Mapping[str, str], repeat: int, table: np.ndarray, names: list[str]
) -> Trial:
    columns = {key: table[:, names.index(name)] for key, name in SOURCES.items()}
    columns["angle"], lost = servo.despiked(columns["angle"])
    try:
        lever, mass = float(row["length"]), float(row["mass"])
        gain, told = float(row["kp"]), float(row["vin"])
    except ValueError as error:
        raise FormatError(f"Index of run {row['file']!r}: {error}.") from None
    conditions = {
        "run": row["file"],
        "mass": mass,
        "lever": lever,
        "arm_mass": ARM_MASSES.get(round(lever, 3), 0.0),
        "gain": gain,
        "voltage": float(np.median(columns["voltage"])),
        "voltage_told": told,
        "quantisation": QUANTISATION,
        "trajectory": row["trajectory"],
        "repeat": repeat,
        "lost_samples": lost,
    }
    return servo.trial(columns, CHANNELS, conditions=conditions, where=row["file"])
