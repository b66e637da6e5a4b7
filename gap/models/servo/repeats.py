"""Runs that are not what their repeats are: they stand still, or end up elsewhere.

A log that hangs for a second, or a servo that does, is no property of its setting; left
in, it teaches the reference that the nominal law errs there by any amount. Repeats of
the same setting and trajectory show it. A lone run is not judged.
"""

import numpy as np
from numpy.lib.stride_tricks import sliding_window_view

from bns.gap.models.servo.runs import SAMPLE, Runs, cells

STILL = 0.5  # [s] that a run has to stand
STANDS = 0.004  # [rad] what it may move then: two to three counts of the encoder
MOVES = 0.05  # [rad] what its repeats move then; 1 of 200 sound runs reaches 0.04
APART = 0.05  # [rad] mean distance of a run that disagrees; sound ones stay below 0.03
AGREE = 3.0  # times less than that have its repeats to differ from each other


def odd(runs: Runs) -> dict[int, str]:
    """What is wrong with runs that are not as their repeats, by index.

    Args:
        runs: repeats and trajectories of any number of settings.

    Returns:
        One line for each run to leave out; of repeats that all are odd, all.
    """
    groups: dict[tuple, list[int]] = {}
    for index, key in enumerate(keys(runs)):
        groups.setdefault(key, []).append(index)
    found: dict[int, str] = {}
    for members in groups.values():
        found |= _odd_of(runs, members)
    return found


def _odd_of(runs: Runs, members: list[int]) -> dict[int, str]:
    """The worst of repeats first; the others are then judged without it."""
    left, found = list(members), {}
    while len(left) > 1:
        judged = []
        for number, index in enumerate(left):
            others = runs.angles[left[:number] + left[number + 1 :]]
            own = runs.angles[index]
            judged.append((*max(_still(own, others), _apart(own, others)), index))
        size, said, index = max(judged)
        if not size:
            break
        left.remove(index)
        found[index] = f"{name(runs, index)}: {said}"
    return found


def sound(runs: Runs) -> tuple[Runs, tuple[str, ...]]:
    """The runs without the odd ones, and a line for each that is left out."""
    found = odd(runs)
    keep = np.array([index not in found for index in range(len(runs))], dtype=bool)
    return (runs.take(keep), tuple(found.values())) if found else (runs, ())


def keys(runs: Runs) -> list[tuple]:
    """Setting and trajectory of each run: alike for repeats."""
    return list(zip(cells(runs), runs.labels["trajectory"], strict=True))


def name(runs: Runs, index: int) -> str:
    """A run in words: its setting, trajectory, and number where it has one."""
    (mass, lever, gain), kind = keys(runs)[index]
    told = f"{kind}, mass {mass:g} kg, lever {lever:g} m, gain {gain:g}"
    number = runs.labels.get("repeat")
    return told if number is None else f"{told}, repeat {number[index]}"


def _still(angles: np.ndarray, others: np.ndarray) -> tuple[float, str]:
    """How far all repeats move where a run stands [rad], and that in words."""
    width = round(STILL / SAMPLE)
    if len(angles) <= width:
        return 0.0, ""
    own, theirs = _spans(angles, width), _ways(others, width).min(axis=0)
    more = np.where(own < STANDS, theirs, 0.0)
    at = int(more.argmax())
    if more[at] < MOVES:
        return 0.0, ""
    return float(more[at]), (
        f"stands still about {at * SAMPLE + STILL / 2:.1f} s, where its repeats move "
        f"{more[at]:.2f} rad in {STILL:g} s."
    )


def _apart(angles: np.ndarray, others: np.ndarray) -> tuple[float, str]:
    """How far a run is from repeats that agree with each other [rad], in words."""
    middle = np.median(others, axis=0)
    away = float(np.abs(angles - middle).mean())
    theirs = float(np.abs(others - middle).mean(axis=1).max())
    if len(others) < 2 or away < max(APART, AGREE * theirs):
        return 0.0, ""
    said = f"is {away:.2f} rad away from repeats that agree within {theirs:.2f} rad."
    return away, said


def _ways(angles: np.ndarray, width: int) -> np.ndarray:
    """Span of each window without its largest step.

    A log that hung jumps where it goes on: no reason to blame the repeat that stood.
    """
    steps = sliding_window_view(np.abs(np.diff(angles, axis=-1)), width - 1, axis=-1)
    return np.minimum(_spans(angles, width), steps.sum(axis=-1) - steps.max(axis=-1))


def _spans(angles: np.ndarray, width: int) -> np.ndarray:
    seen = sliding_window_view(angles, width, axis=-1)
    return seen.max(axis=-1) - seen.min(axis=-1)
