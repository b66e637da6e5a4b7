"""What a log does not tell of commands: when they began, where it tells that to a
sample only, and what they were in rows that it lost."""

from dataclasses import dataclass

import numpy as np

from bns.gap.models.base import Windows
from bns.gap.recordings import trial_conditions
from bns.worlds.trial import Commands, Trial

AFTER = 0.3  # [s] until it is felt no more that a command began sooner; assumed
LONGEST = 1000  # commands of a trial; of more, all are taken to begin where logged
MOST = 12  # simulations of a trial, each with every so manieth command moved
STRETCHES = 8  # of lost rows, by channel, that are open in a trial: the least sure


@dataclass(frozen=True, eq=False)
class Untold:
    """A trial some of whose commands were otherwise than its log tells, each so that it
    is felt by itself.

    Attributes:
        trial: the trial, as it may have been.
        commands: numbers of these commands, ``(K,)``.
        begin, end: from when until when each is felt [s], ``(K,)``.
        size: by how many standard deviations each is off.
    """

    trial: Trial
    commands: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    size: float

    def directions(self, change: np.ndarray, windows: Windows) -> np.ndarray:
        """What a standard deviation of each command changes.

        Args:
            change: of the features of the trial, all commands together, ``(n, C)``.
            windows: n windows that the features are of.

        Returns:
            ``(K, n, C)``.
        """
        last = self.trial.times[windows.last]
        felt = (last > self.begin[:, None]) & (last <= self.end[:, None])
        return felt[..., None] * np.nan_to_num(change / self.size)


def sooner(trial: Trial, dt: float) -> list[Untold]:
    """A trial with its commands begun sooner, in turn.

    A command begins between the sample before the first that tells it and that one,
    anywhere with the same chance. The first of a trial begins with it.

    Args:
        trial: recorded; none are made where it is known when its commands began, nor
            of more than `LONGEST`.
        dt: physics step [s], in whole numbers of which commands are moved; 0 = any.
    """
    count = len(trial.commands)
    if not 2 <= count <= LONGEST or not trial_conditions.moments_sampled([trial]):
        return []
    step = trial_conditions.sample_step(trial)
    move = step / 2 if dt == 0 else max(1, round(step / 2 / dt)) * dt
    lasting = trial.commands.durations
    starts = trial_conditions.begun(trial)
    apart = int(np.clip(np.ceil(AFTER / np.median(lasting)), 1, MOST))
    ends = np.append(starts[apart:], np.full(min(apart, count), np.inf)) - step
    able = np.flatnonzero(lasting[:-1] > move) + 1
    made = []
    for turn in range(apart):
        which = able[able % apart == turn]
        if not len(which):
            continue
        durations = lasting.copy()
        durations[which - 1] -= move
        durations[which] += move
        told = Commands(trial.commands.values, durations, trial.commands.channels)
        moved = trial.replace(commands=told)
        size = move / (step / np.sqrt(12))
        made.append(Untold(moved, which, starts[which] - step, ends[which], size))
    return made


def lost(trial: Trial) -> list[Untold]:
    """A trial with commands of lost rows as they may have been, in turn.

    Args:
        trial: recorded; none are made where no row was lost.
    """
    between = trial_conditions.between(trial)
    if not between.any():
        return []
    told = trial.commands
    edges = np.flatnonzero(np.diff(np.concatenate([[0], between, [0]])))
    open_ = [
        (size * (last - first), channel, first, last, size)
        for first, last in edges.reshape(-1, 2).tolist()
        for channel, size in enumerate(_apart(told.values, between, last - first))
        if size > 0
    ]
    made = []
    for _, channel, first, last, size in sorted(open_, reverse=True)[:STRETCHES]:
        values = told.values.copy()
        values[first:last, channel] += size
        moved = Commands(values, told.durations, told.channels)
        other, ever = trial.replace(commands=moved), np.full(1, np.inf)
        made.append(Untold(other, np.array([first]), -ever, ever, 1.0))
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
