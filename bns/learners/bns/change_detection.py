"""Damage detection without extra sensors (thesis 8.5), from one-step innovations.

After each trial, before training on it, the SNNs' misses are divided by what they
ought to err by: the disagreement of the ensemble's members, the error on their own
training patterns, there and overall, a floor, and what grows with the distance from
those patterns, since SNNs are sure of themselves where they have never been, members
of an ensemble alike. Squared, that is the normalised innovation of filtering
(Bar-Shalom, Li and Kirubarajan 2001, section 5.4), 1 or less while the robot is the one
that was learned. A trial's innovation is the mean of its few largest: damage shows in
few patterns where the others are on new ground, or where it is intermittent. Each
channel (a wheel, a sensor) has its own; the one that rises most over what is usual in
its run names what is damaged.

Of walkers: patterns of walking lie too far apart to be compared with their nearest
neighbours, as `forgetting` does. But two accounts of them can be weighed: one smooth
function for all trials, or one for the old and another for the new. A Gaussian process
(Rasmussen and Williams 2006, equation 2.30) predicts each new trial under either
account, and the difference of the log probabilities is the evidence for a change. On
ground that the old trials did not see, both predict alike.

Neither how well the networks are trained nor the usual error enters, so that a fresh
simulator is no change; and since the trial that says most does not count, nor is one
odd trial, such as a fall.

All numbers of `changed` were chosen on ten undamaged runs of 100 trials, where the
evidence never came above 4.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bns.learners.bns.config import WatchConfig

LEAST = 0.5  # innovation that is usual where a history's median is lower; assumed


class Alarms(NamedTuple):
    """What was found after a trial.

    Attributes:
        on: runs with an alarm, ``(R,)`` bool.
        suspect: channel that rose most, ``(R,)``; -1 without an alarm.
        score: that channel's innovation over what is usual, ``(R,)``; NaN while there
            is too little history.
    """

    on: np.ndarray
    suspect: np.ndarray
    score: np.ndarray


@dataclass(eq=False)
class Detector:
    """Innovations of R runs over trials, C channels each.

    Attributes:
        config: thresholds.
        past: innovations of the last trials, newest last, ``(R, H, C)``; NaN where
            there is none.
    """

    config: WatchConfig
    past: np.ndarray

    @classmethod
    def fresh(cls, config: WatchConfig, runs: int, channels: int) -> "Detector":
        """A detector that has seen nothing.

        Args:
            config: thresholds, and H, the trials that a history has.
            runs: R.
            channels: C.
        """
        return cls(config, np.full((runs, config.history, channels), np.nan))

    def update(self, innovations: np.ndarray) -> Alarms:
        """Judge a trial, and remember it.

        An alarm starts the history anew: what was usual of the robot before says
        nothing of the one that is learned now, whose misses go up and down for some
        trials. So a change raises one alarm, and for `warmup` trials none follows.

        Args:
            innovations: ``(R, C)``, positive; NaN where nothing was seen.
        """
        score = self._score(innovations, self.past)
        known = np.isfinite(score).any(1)
        filled = np.where(np.isfinite(score), score, -np.inf)
        suspect, worst = filled.argmax(1), filled.max(1)
        on = worst >= self.config.threshold
        self.past = np.concatenate([self.past[:, 1:], innovations[:, None]], axis=1)
        self.past[on] = np.nan
        return Alarms(on, np.where(on, suspect, -1), np.where(known, worst, np.nan))

    def figures(
        self, trial: int, innovations: np.ndarray, onsets: np.ndarray
    ) -> dict[str, np.ndarray]:
        """Judge a trial as `update` does, and say so in a learner's figures.

        Args:
            trial: its number.
            innovations: see `update`.
            onsets: first damaged trial of each run, ``(R,)``; set where there is an
                alarm.

        Returns:
            detected, suspect and alarm_score (see `Alarms`), each ``(R,)``.
        """
        alarms = self.update(innovations)
        onsets[alarms.on] = trial
        return {
            "detected": alarms.on.astype(np.float64),
            "suspect": alarms.suspect.astype(np.float64),
            "alarm_score": alarms.score,
        }

    def _score(self, now: np.ndarray, past: np.ndarray) -> np.ndarray:
        """Times what was usual of late, ``(R, C)``."""
        enough = np.isfinite(past).sum(1) >= self.config.warmup
        ordered = np.where(enough[:, None], past, 0.0)
        usual = np.maximum(np.nanmedian(ordered, axis=1), LEAST)
        return np.where(enough, now / usual, np.nan)


@dataclass(frozen=True, eq=False)
class Ground:
    """Where patterns lie among learned ones.

    Attributes:
        known: whether one of them is within `reach`, ``(N,)`` bool.
        nearest: the `near` nearest ones, ``(N, near)`` indices.
        far: distance of the last of those, scaled, ``(N,)``.
    """

    known: np.ndarray
    nearest: np.ndarray
    far: np.ndarray

    @classmethod
    def of(
        cls, inputs: np.ndarray, learned: np.ndarray, config: WatchConfig
    ) -> "Ground":
        """The ground of some patterns.

        Args:
            inputs: of the patterns, scaled, ``(N, I)``.
            learned: inputs of the patterns that were trained on, ``(M, I)``.
            config: thresholds.
        """
        count, near = len(inputs), config.near
        if len(learned) < near:
            none = np.zeros((count, near), np.int64)
            return cls(np.zeros(count, bool), none, np.full(count, np.inf))
        square = (inputs**2).sum(1)[:, None] + (learned**2).sum(1)
        square = square - 2 * inputs @ learned.T
        nearest = np.argpartition(square, near - 1, axis=1)[:, :near]
        there = np.take_along_axis(square, nearest, axis=1).clip(min=0)
        known = there.min(axis=1) <= config.reach**2
        return cls(known, nearest, np.sqrt(there.max(axis=1)))


class Misses(NamedTuple):
    """How far SNNs are off, N patterns and C channels.

    Attributes:
        new: on the patterns of a trial, ``(N, C)``.
        doubt: variance of the ensemble's members there, ``(N, C)``; 0 without one.
        learned: on the patterns they were trained on, ``(M, C)``.
        usual: RMS of those, ``(C,)``.
    """

    new: np.ndarray
    doubt: np.ndarray
    learned: np.ndarray
    usual: np.ndarray


def innovation(
    misses: Misses, ground: Ground, config: WatchConfig, unit: float = 1.0
) -> np.ndarray:
    """Misses over what is to be expected, squared, mean of a trial's largest.

    Args:
        misses: of the SNNs.
        ground: where the trial's patterns lie among the learned ones.
        config: thresholds.
        unit: the largest motion or reading, in units of the misses.

    Returns:
        ``(C,)``; NaN with too few patterns on known ground.
    """
    known = ground.known
    if known.sum() < config.near:
        return np.full(misses.new.shape[1], np.nan)
    here = np.mean(misses.learned[ground.nearest[known]] ** 2, axis=1)
    blind = config.floor**2 + (config.grow * ground.far[known]) ** 2
    expected = (
        misses.doubt[known]
        + np.maximum(misses.usual**2, here)
        + blind[:, None] * unit**2
    )
    ratios = np.sort(misses.new[known] ** 2 / expected, axis=0)
    largest: np.ndarray = ratios[-config.largest :].mean(axis=0)
    return largest


REACH = 2 / 3  # length scale, times the root of the number of inputs; assumed
NOISE = 0.15  # variance of what no function of the goals tells, as a share; assumed
LARGEST = 4.0  # scaled outputs beyond are cut off: a tumble says no more; assumed
ODDS = 10.0  # natural logarithm; more is a change; assumed
NEW = (2, 3, 4, 5, 6)  # trials that the newest account may be of
OLD = 6  # trials that the old one has at least


def changed(inputs: np.ndarray, targets: np.ndarray, size: int) -> int:
    """How many of the newest patterns are of another robot than those before.

    Args:
        inputs, targets: scaled patterns, newest last, ``(N, I)`` and ``(N, O)``.
        size: patterns of a trial.

    Returns:
        Their number, 0 = nothing speaks for a change.
    """
    trials = len(inputs) // size
    wanted = [new for new in NEW if trials >= OLD + new]
    if not wanted:
        return 0
    seen, told = (a[-trials * size :].astype(float) for a in (inputs, targets))
    told = told.clip(-LARGEST, LARGEST)
    like, scale = covariance(seen), np.maximum((told**2).mean(0), 1e-12)
    together, found = foretold(like, told, scale), []
    for some in (new * size for new in wanted):
        alone = foretold(like[-some:, -some:], told[-some:], scale)
        found.append((_evidence(alone - together[-some:], size), some))
    most, newest = max(found)
    return newest if most > ODDS else 0


def _evidence(gain: np.ndarray, size: int) -> float:
    """Logarithm of the odds of two accounts: what all trials but the strongest say."""
    by_trial = gain.reshape(-1, size).sum(1)
    return float(by_trial.sum() - max(by_trial.max(), 0.0))


def covariance(inputs: np.ndarray) -> np.ndarray:
    """Of the patterns' outputs, their mean square being 1, ``(N, N)``.

    A constant, a smooth function of the inputs and noise.
    """
    squares = (inputs**2).sum(1)
    apart = squares[:, None] + squares - 2 * inputs @ inputs.T
    reach = REACH**2 * inputs.shape[1]
    alike = np.exp(-np.maximum(apart, 0.0) / (2 * reach))
    found: np.ndarray = 1.0 + alike + NOISE * np.eye(len(inputs))
    return found


def foretold(like: np.ndarray, told: np.ndarray, scale: np.ndarray) -> np.ndarray:
    """Log probability of each pattern, the earlier ones known, ``(N,)``.

    Args:
        like: covariance of the patterns ``(N, N)``.
        told: outputs ``(N, O)``, or several accounts of them ``(N, A, O)``: then the
            result is ``(N, A)``.
        scale: mean square of each output ``(O,)``.
    """
    root = np.linalg.cholesky(like)
    fresh = np.linalg.solve(root, told.reshape(len(told), -1)).reshape(told.shape)
    spread = np.log(np.diag(root)) * told.shape[-1] + np.log(scale).sum() / 2
    squares = (fresh**2 / scale).sum(-1) / 2
    found: np.ndarray = -squares - spread.reshape(-1, *[1] * (told.ndim - 2))
    return found
