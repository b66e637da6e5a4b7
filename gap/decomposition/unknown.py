"""Commands of rows that a log lost, of which neighbours tell about what they were."""

from dataclasses import dataclass

import numpy as np

from bns.gap.models.base import Windows
from bns.gap.recordings import trial_conditions
from bns.worlds.trial import Commands, Trial

MOST = 8  # stretches of a channel that are open in a trial; the least sure ones


@dataclass(frozen=True, eq=False)
class Unknown:
    """A trial that was told otherwise in one stretch, by one channel.

    Attributes:
        trial: the trial, its commands off by a standard deviation there.
    """

    trial: Trial

    def directions(self, change: np.ndarray, windows: Windows) -> np.ndarray:
        """What a standard deviation changes, ``(1, n, C)``.

        Args:
            change: of the features of the trial, ``(n, C)``.
            windows: n windows that the features are of.
        """
        return np.nan_to_num(change)[None]


def unknown(trial: Trial) -> list[Unknown]:
    """A trial with commands of lost rows as they may have been, in turn.

    Args:
        trial: recorded; none are made where no row was lost.
    """
    lost = trial_conditions.between(trial)
    if not lost.any():
        return []
    told = trial.commands
    edges = np.flatnonzero(np.diff(np.concatenate([[0], lost, [0]])))
    open_ = [
        (size * (last - first), channel, first, last, size)
        for first, last in edges.reshape(-1, 2).tolist()
        for channel, size in enumerate(_apart(told.values, lost, last - first))
        if size > 0
    ]
    made = []
    for _, channel, first, last, size in sorted(open_, reverse=True)[:MOST]:
        values = told.values.copy()
        values[first:last, channel] += size
        moved = Commands(values, told.durations, told.channels)
        made.append(Unknown(trial.replace(commands=moved)))
    return made


def _apart(values: np.ndarray, lost: np.ndarray, count: int) -> np.ndarray:
    """How far the mean of so many commands is from that of the ones before and after
    them, where all are known, root mean square, ``(C,)``; 0 = nowhere.

    Args:
        values: commands, ``(K, C)``.
        lost: which are not known, ``(K,)``.
        count: of commands.
    """
    sums = np.cumsum(np.concatenate([np.zeros((1, values.shape[1])), values]), axis=0)
    missing = np.concatenate([[0], np.cumsum(lost)])
    first = np.arange(len(values) - count - 1)
    known = missing[first + count + 2] == missing[first]
    first = first[known]
    if not len(first):
        return np.zeros(values.shape[1])
    inside = (sums[first + count + 1] - sums[first + 1]) / count
    ends = (values[first] + values[first + count + 1]) / 2
    made: np.ndarray = np.sqrt(np.mean((inside - ends) ** 2, axis=0))
    return made
