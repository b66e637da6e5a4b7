"""Trials in pieces: windows between samples and what was told in them, stretches
between two samples, and a share of long recordings."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bns.gap.models.base import Windows
from bns.gap.recordings import trial_conditions
from bns.worlds.trial import Commands, Trial

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


GOLDEN = (np.sqrt(5.0) - 1.0) / 2.0  # spreads the stretches over their trials
SHORTEST = 8.0  # [s] of a trial below which nothing is left out of it


def piece(trial: Trial, first: int, last: int) -> Trial:
    """Samples first to last of a trial, and the commands between them.

    Args:
        trial: recorded.
        first, last: numbers of its samples; both are kept.
    """
    bounds = trial.boundaries
    dense = len(np.unique(bounds)) < len(bounds)
    told, marks = (_dense if dense else _sampled)(trial, first, last)
    return trial.replace(
        commands=told,
        times=trial.times[first : last + 1] - trial.times[first],
        observed=trial.observed[first : last + 1],
        boundaries=marks - first,
        handled=np.zeros(0, bool),
        conditions=trial_conditions.since(trial.conditions, trial.times[first]),
        truth={},
    )


def _sampled(trial: Trial, first: int, last: int) -> tuple[Commands, np.ndarray]:
    """Commands between two samples, and the samples at which they begin and end: each
    lasts from its sample to the next one's."""
    told, bounds = trial.commands, trial.boundaries
    begun, ends = trial.times[bounds], trial.times[[first, last]]
    inner = bounds[(begun > ends[0]) & (begun < ends[1])]
    marks = np.concatenate([[first], inner, [last]])
    index = np.searchsorted(begun, trial.times[marks[:-1]], side="right") - 1
    index = np.clip(index, 0, len(bounds) - 2)
    lasting = np.diff(trial.times[marks])
    return Commands(told.values[index], lasting, told.channels), marks


def _dense(trial: Trial, first: int, last: int) -> tuple[Commands, np.ndarray]:
    """The same where several commands fall between two samples: by their own times."""
    told, times = trial.commands, trial.times
    begun, (since, until) = trial_conditions.begun(trial), times[[first, last]]
    low = max(int(np.searchsorted(begun, since, side="right")) - 1, 0)
    high = max(int(np.searchsorted(begun, until)), low + 1)
    edges = np.concatenate([[since], begun[low + 1 : high], [until]])
    marks = np.searchsorted(times, edges - 1e-9)
    marks[[0, -1]] = first, last
    return Commands(told.values[low:high], np.diff(edges), told.channels), marks


def shortened(
    trials: Sequence[Trial], most: float, before: float
) -> list[tuple[Trial, float]]:
    """A recording cut to so many seconds, the same share of each trial.

    Of each long trial one stretch is kept, in turn near its begin and near its end, so
    that all of a drive is seen in some trial.

    Args:
        trials: recorded.
        most: seconds that are kept of all trials together.
        before: seconds before a stretch that are kept as well: until a robot that is
            simulated from rest moves as it did.

    Returns:
        each trial, and the time until which nothing of it counts [s].
    """
    spans = [float(trial.times[-1] - trial.times[0]) for trial in trials]
    total = sum(spans)
    if total <= most:
        return [(trial, 0.0) for trial in trials]
    made = []
    for number, (trial, span) in enumerate(zip(trials, spans, strict=True)):
        length = max(SHORTEST, span * most / total)
        if length + before >= span:
            made.append((trial, 0.0))
            continue
        begin = trial.times[0] + (span - length) * ((number * GOLDEN) % 1.0)
        first = int(np.searchsorted(trial.times, begin - before))
        last = min(
            int(np.searchsorted(trial.times, begin + length)), len(trial.times) - 1
        )
        begun = 0.0 if first == 0 else before
        made.append((piece(trial, first, last), begun))
    return made
