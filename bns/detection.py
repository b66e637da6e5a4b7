"""Damage detection without extra sensors (thesis 8.5), from one-step innovations.

After each trial, before training on it, the SNNs' misses are divided by what they
ought to err by: the disagreement of the ensemble's members, the error on their own
training patterns, and a floor. The mean square of that is the normalised innovation
squared of filtering (Bar-Shalom, Li and Kirubarajan 2001, section 5.4), 1 while the
robot is the one that was learned. SNNs are sure of themselves where they have never
been, members of an ensemble alike, so only patterns on known ground count: those with
several learned ones nearby. Each channel (a wheel, a sensor) has its own innovation;
the one that rises most names what is damaged.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bns.config_watch import WatchConfig

USUAL = 0.9  # quantile of its history that an innovation is compared with; assumed


class Alarms(NamedTuple):
    """What was found after a trial.

    Attributes:
        on: runs with an alarm, ``(R,)`` bool.
        suspect: channel that rose most, ``(R,)``; -1 without an alarm.
        score: that channel's innovation over what it ought to be, ``(R,)``; NaN while
            there is too little history.
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
        """A detector that has seen nothing."""
        return cls(config, np.full((runs, config.history, channels), np.nan))

    def update(self, innovations: np.ndarray) -> Alarms:
        """Judge a trial, and remember it.

        An alarm is a rise: none follows while the trial before stood out as well, and
        what stood out twice is history that later trials are compared with. So a
        robot that is still being learned raises no second alarm, while one false
        alarm leaves nobody blind.

        Args:
            innovations: ``(R, C)``, positive; NaN where nothing was seen.
        """
        score = self._score(innovations, self.past)
        before = self._score(self.past[:, -1], self.past[:, :-1])
        risen = ~(before >= self.config.threshold).any(1)
        known = np.isfinite(score).any(1)
        filled = np.where(np.isfinite(score), score, -np.inf)
        suspect, worst = filled.argmax(1), filled.max(1)
        on = known & risen & (worst >= self.config.threshold)
        self.past = np.concatenate([self.past[:, 1:], innovations[:, None]], axis=1)
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
        """Times what it ought to be: 1, or what it was of late, ``(R, C)``."""
        enough = np.isfinite(past).sum(1) >= self.config.warmup
        ordered = np.where(enough[:, None], past, 0.0)
        usual = np.maximum(np.nanquantile(ordered, USUAL, axis=1), 1.0)
        return np.where(enough, now / usual, np.nan)


def familiar(
    inputs: np.ndarray, learned: np.ndarray, config: WatchConfig
) -> np.ndarray:
    """Which patterns are on known ground: `near` learned ones are within `reach`.

    Args:
        inputs: of the patterns, scaled, ``(N, I)``.
        learned: inputs of the patterns that were trained on, ``(M, I)``.
        config: thresholds.

    Returns:
        ``(N,)`` bool.
    """
    if len(learned) < config.near:
        return np.zeros(len(inputs), bool)
    square = (inputs**2).sum(1)[:, None] + (learned**2).sum(1) - 2 * inputs @ learned.T
    last = np.partition(square, config.near - 1, axis=1)[:, config.near - 1]
    return last <= config.reach**2


def innovation(
    miss: np.ndarray,
    disagreement: np.ndarray,
    usual: np.ndarray,
    known: np.ndarray,
    config: WatchConfig,
    unit: float = 1.0,
) -> np.ndarray:
    """Misses over what is to be expected, squared, mean of a trial on known ground.

    Args:
        miss: of each pattern and channel, ``(N, C)``.
        disagreement: variance of the ensemble's members, ``(N, C)``; 0 without one.
        usual: RMS error on the patterns trained on, ``(C,)``.
        known: see `familiar`, ``(N,)`` bool.
        config: thresholds.
        unit: the largest motion or reading, in units of `miss`.

    Returns:
        ``(C,)``; NaN with too few patterns.
    """
    if known.sum() < config.near:
        return np.full(miss.shape[1], np.nan)
    expected = disagreement + usual**2 + (config.floor * unit) ** 2
    return np.mean((miss**2 / expected)[known], axis=0)
