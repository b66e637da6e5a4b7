"""What the conditions of recorded trials say: numbers, what a trial is called, and
when its commands began. A file may hold anything there."""

from collections.abc import Mapping, Sequence
from typing import SupportsFloat

import numpy as np

from bns.errors import FormatError
from bns.worlds.data.importing import MOMENTS
from bns.worlds.trial import Trial

NUMBER, RUN, RECORDING = "number", "run", "recording"
"""conditions that say which trial it was; `bns.gap.recordings.load_recordings` writes
them"""

SERVO = "servo"
"""condition of a trial of a servo whose law is known: its name"""

BETWEEN = "commands_between"
"""condition of a trial of which rows were lost: when commands began that were put
between those that are known [s]"""

SAME = 1e-6  # [s] moments that are nearer are one

SAMPLED = "sampled"
"""condition of a trial of which every k-th sample is kept: of all samples the time
between them (`step` [s]) and the median third difference of each channel (`rough`)"""


def as_number(
    conditions: Mapping[str, object], name: str, default: float = 0.0
) -> float:
    """A condition that is a number.

    Args:
        conditions: of a trial, by name.
        name: of the condition.
        default: where the trial has no such condition.

    Raises:
        FormatError: it is no number.
    """
    value = conditions.get(name, default)
    if isinstance(value, str | SupportsFloat):
        try:
            return float(value)
        except ValueError:
            pass
    raise FormatError(f"Condition {name!r} of a trial is {value!r}; give a number.")


def labelled(trial: Trial, number: int, **others: object) -> Trial:
    """A trial that knows its number, and its run and recording where told."""
    known = {key: value for key, value in others.items() if value is not None}
    return trial.replace(conditions={**trial.conditions, NUMBER: number, **known})


def label(trial: Trial, place: int) -> str:
    """Such as "trial 16 of run 1".

    Args:
        trial: of a recording.
        place: its place among all, which is its number if it has none.
    """
    known = trial.conditions
    parts = [f"trial {known.get(NUMBER, place)}"]
    parts += [f"run {known[RUN]}"] if RUN in known else []
    parts += [str(known[RECORDING])] if RECORDING in known else []
    return " of ".join(parts)


def since(conditions: Mapping[str, object], time: float) -> Mapping[str, object]:
    """Conditions of what of a trial comes after a time [s], counted from there."""
    known = conditions.get(BETWEEN)
    if not isinstance(known, list):
        return conditions
    return {**conditions, BETWEEN: [begun - time for begun in known if begun > time]}


def between(trial: Trial) -> np.ndarray:
    """Which commands were put between those that are known, ``(K,)``."""
    known = trial.conditions.get(BETWEEN)
    moments = np.array(known if isinstance(known, list) else [], dtype=float)
    return (np.abs(begun(trial)[:, None] - moments) < SAME).any(axis=1)


def begun(trial: Trial) -> np.ndarray:
    """When each command of a trial began by its log [s], ``(K,)``."""
    lasting = trial.commands.durations
    made: np.ndarray = trial.times[trial.boundaries[0]] + np.cumsum(lasting) - lasting
    return made


def numbers(trials: Sequence[Trial]) -> list[int]:
    """The number of each, or the places where they have none or share one."""
    own = [trial.conditions.get(NUMBER) for trial in trials]
    known = [number for number in own if isinstance(number, int)]
    if len(known) == len(own) and len(set(known)) > 1:
        return known
    return list(range(len(trials)))


def moments_sampled(trials: Sequence[Trial]) -> list[Trial]:
    """Trials of which it is known to a sample only when commands began."""
    return [trial for trial in trials if trial.conditions.get(MOMENTS) == "sampled"]


def moments_unknown(trials: Sequence[Trial]) -> float:
    """Seconds within which it is not known when commands began; 0 = it is known."""
    found = moments_sampled(trials)
    if not found:
        return 0.0
    return float(np.median([sample_step(trial) for trial in found]))


def sample_step(trial: Trial) -> float:
    """Time between samples of a trial as it was recorded [s]."""
    known = trial.conditions.get(SAMPLED)
    if isinstance(known, Mapping):
        return as_number(known, "step")
    return float(np.median(np.diff(trial.times)))


def third_differences(trial: Trial) -> np.ndarray:
    """Sizes of the third differences of what was seen, ``(n, n_channels)``: those of
    all samples, where samples were left out their median."""
    seen = trial.observed[np.isfinite(trial.observed).all(axis=1)]
    sizes = np.abs(np.diff(seen, n=3, axis=0))
    known = trial.conditions.get(SAMPLED)
    if isinstance(known, Mapping):
        return np.broadcast_to(known["rough"], sizes.shape)
    return sizes
