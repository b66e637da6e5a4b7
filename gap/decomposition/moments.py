"""Commands of which a log tells to a sample only when they began."""

from dataclasses import dataclass

import numpy as np

from bns.gap.models.base import Windows
from bns.gap.recordings import trial_conditions
from bns.worlds.trial import Commands, Trial

AFTER = 0.3  # [s] until it is felt no more that a command began sooner; assumed
LONGEST = 1000  # commands of a trial; of more, all are taken to begin where logged
MOST = 12  # simulations of a trial, each with every so manieth command moved


@dataclass(frozen=True, eq=False)
class Sooner:
    """A trial some of whose commands begin sooner, so far apart that each is felt by
    itself.

    Attributes:
        trial: the trial.
        commands: numbers of these commands, ``(K,)``.
        begin, end: from when until when each is felt [s], ``(K,)``.
        size: standard deviations of its moment by which each began sooner.
    """

    trial: Trial
    commands: np.ndarray
    begin: np.ndarray
    end: np.ndarray
    size: float

    def directions(self, change: np.ndarray, windows: Windows) -> np.ndarray:
        """What a standard deviation of the moment of each command changes.

        Args:
            change: of the features of the trial, all commands together, ``(n, C)``.
            windows: n windows that the features are of.

        Returns:
            ``(K, n, C)``.
        """
        last = self.trial.times[windows.last]
        felt = (last > self.begin[:, None]) & (last <= self.end[:, None])
        return felt[..., None] * np.nan_to_num(change / self.size)


def sooner(trial: Trial, dt: float) -> list[Sooner]:
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
    starts = trial.times[trial.boundaries[0]] + np.cumsum(lasting) - lasting
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
        made.append(Sooner(moved, which, starts[which] - step, ends[which], size))
    return made
