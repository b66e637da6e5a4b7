"""Runs of a Dynamixel XL330 on a pendulum in the form of BAM's raw logs.

One JSON file per run: `mass` [kg], `length` [m], `kp`, `vin` [V], `motor`,
`trajectory` and `entries`, each with timestamp [s], position, goal_position [rad],
speed [rad/s], load (present current [mA]), input_volts [V], temp and torque_enable.

Known faults, and what is done: `load` is a signed 16-bit number stored as unsigned
(65535 is -1) and is unwrapped; lone samples of lost packets are mended; the lever's own
mass is not told (0 is assumed).
"""

from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import servo
from bns.gap.recordings.trial_conditions import SERVO
from bns.storage import reading
from bns.worlds.trial import Channel, Trial

CHANNELS = (
    Channel("angle", "rad"),
    Channel("speed", "rad/s"),
    Channel("current", "A"),
    Channel("voltage", "V"),
    Channel("temperature", "degC"),
)
ENTRIES = {
    "time": "timestamp",
    "angle": "position",
    "speed": "speed",
    "goal": "goal_position",
    "torque_on": "torque_enable",
    "current": "load",
    "voltage": "input_volts",
    "temperature": "temp",
}
METADATA = ("mass", "length", "kp", "vin", "trajectory")
QUANTISATION = 2 * np.pi / 4096  # [rad] 12-bit encoder
NAME = "xl330"  # of the servo whose law is nominal (`bns.models.xl330`)


def read(directory: str | Path) -> list[Trial]:
    """All runs of a directory, by file name.

    Conditions: run, servo, mass [kg], lever [m], arm_mass [kg], gain, voltage (median
    reading) and voltage_told [V], quantisation [rad], trajectory, repeat, lost_samples.

    Raises:
        FormatError: no JSON file, or one that is not such a run.
    """
    files = sorted(Path(directory).glob("*.json"))
    if not files:
        raise FormatError(f"{directory} holds no .json file; give a directory of runs.")
    trials = []
    seen: dict[tuple[object, ...], int] = {}
    for file in files:
        trial = _trial(file)
        told = trial.conditions
        cell = (told["mass"], told["lever"], told["gain"], told["trajectory"])
        seen[cell] = seen.get(cell, -1) + 1
        trials.append(trial.replace(conditions={**told, "repeat": seen[cell]}))
    return trials


def _trial(file: Path) -> Trial:
    try:
        content = reading.read_json(file, most=reading.DATA)
        about = {name: content[name] for name in METADATA}
        columns = {
            key: np.array([float(entry[name]) for entry in content["entries"]])
            for key, name in ENTRIES.items()
        }
        if len(columns["time"]) < 2:
            raise FormatError(
                f"{file} has {len(columns['time'])} samples, 2 are needed."
            )
        mass, lever = float(about["mass"]), float(about["length"])
        gain, told = float(about["kp"]), float(about["vin"])
    except FormatError:
        raise
    except (ArithmeticError, KeyError, TypeError, ValueError) as error:
        raise FormatError(
            f"{file} is no run of an XL330: {error!r}. A run has {', '.join(METADATA)} "
            f"and entries, each with {', '.join(ENTRIES.values())}."
        ) from None
    columns["current"] = servo.signed(columns["current"]) * 1e-3
    columns["angle"], lost = servo.despiked(columns["angle"])
    conditions = {
        "run": file.stem,
        SERVO: NAME,
        "mass": mass,
        "lever": lever,
        "arm_mass": 0.0,
        "gain": gain,
        "voltage": float(np.median(columns["voltage"])),
        "voltage_told": told,
        "quantisation": QUANTISATION,
        "trajectory": str(about["trajectory"]),
        "lost_samples": lost,
    }
    return servo.trial(columns, CHANNELS, conditions=conditions, where=str(file))
