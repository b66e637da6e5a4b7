"""Trials in pieces: windows between samples, and what was told in them."""

from typing import NamedTuple

import numpy as np

from bns.gap.models.base import Windows
from bns.worlds.trial import Trial

# Place and heading in a regime are told this coarsely [m, m, rad]: finer, they would
# hold the tracker's noise, which is in the residuals of the same samples as well.
COARSE = 0.03, 0.03, 0.1


class Told(NamedTuple):
    """What a robot was told in each of W windows.

    Attributes:
        command: its number, ``(W,)``.
        since: time since it began [s].
        at: time in the trial [s].
    """

    command: np.ndarray
    since: np.ndarray
    at: np.ndarray


def told(trial: Trial, windows: Windows) -> Told:
    """The command that was in force in the middle of each window."""
    lasting = trial.commands.durations
    ends = np.cumsum(lasting)
    at = windows.times - trial.times[trial.boundaries[0]]
    index = np.minimum(np.searchsorted(ends, at), len(ends) - 1)
    return Told(index, at - (ends - lasting)[index], at)


def moved(
    poses: np.ndarray, start: np.ndarray, origin: np.ndarray | None = None
) -> np.ndarray:
    """Poses as if they had begun at `start`, not at `origin` (None = the first)."""
    origin = poses[0] if origin is None else origin
    turn = start[2] - origin[2]
    cos, sin = np.cos(turn), np.sin(turn)
    x, y = (poses[:, :2] - origin[:2]).T
    return np.column_stack(
        [start[0] + cos * x - sin * y, start[1] + sin * x + cos * y, poses[:, 2] + turn]
    )


def windows(trial: Trial, length: float) -> Windows:
    """Windows of at least a length [s] that tile a trial, between seen samples.

    Args:
        trial: recorded trial.
        length: infinity = one window, from the first sample to the last.
    """
    seen = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
    seen = seen[seen >= trial.boundaries[0]]
    if np.isinf(length):
        marks = seen[[0, -1]] if len(seen) > 1 else seen[:0]
    else:
        kept = list(seen[:1])
        for sample in seen[1:]:
            if trial.times[sample] - trial.times[kept[-1]] >= 0.95 * length:
                kept.append(sample)
        marks = np.array(kept, dtype=int)
    first, last = marks[:-1], marks[1:]
    begin, end = trial.times[first], trial.times[last]
    return Windows(first, last, (begin + end) / 2, end - begin)


def overlapping(trial: Trial, length: float) -> Windows:
    """Windows of a length [s] between seen samples, each begun half a length after
    the one before."""
    seen = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
    seen = seen[seen >= trial.boundaries[0]]
    if not len(seen):
        return Windows(seen, seen, np.zeros(0), np.zeros(0))
    times = trial.times[seen]
    first = np.searchsorted(times, np.arange(times[0], times[-1] - length, length / 2))
    last = np.searchsorted(times, times[first] + length - 1e-6)
    inside = last < len(times)
    first, last = seen[first[inside]], seen[last[inside]]
    begin, end = trial.times[first], trial.times[last]
    return Windows(first, last, (begin + end) / 2, end - begin)


def coarse(poses: np.ndarray) -> np.ndarray:
    """Poses ``(T, 3)`` in steps of `COARSE` around their mean, headings unwrapped."""
    poses = np.column_stack([poses[:, :2], np.unwrap(poses[:, 2])])
    mean, step = poses.mean(axis=0), np.array(COARSE)
    return mean + step * np.round((poses - mean) / step)
