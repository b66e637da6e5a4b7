"""Damage detection without extra sensors (thesis 8.5), from one-step innovations.

After each trial, before training on it, the SNNs' misses are divided by what they
ought to err by: the disagreement of the ensemble's members and the error on their own
training patterns. That *innovation* is near one while the robot is the one that was
learned, on known ground and, thanks to the disagreement, on new ground too. Each
channel (a wheel, a sensor) has its own; the one that rises most names what is damaged.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bns.config_watch import WatchConfig

FLOOR = 0.15  # smallest spread of log innovations that is believed; assumed
NORMAL = 1.4826  # median absolute deviation of a normal distribution to its spread


class Alarms(NamedTuple):
    """What was found after a trial.

    Attributes:
        on: runs with an alarm, ``(R,)`` bool.
        suspect: channel that rose most, ``(R,)``; -1 without an alarm.
        score: spreads by which that channel lies above its history, ``(R,)``; NaN
            while there is too little of it.
    """

    on: np.ndarray
    suspect: np.ndarray
    score: np.ndarray


@dataclass(eq=False)
class Detector:
    """Innovations of R runs over trials, C channels each.

    Attributes:
        config: thresholds.
        past: log innovations of the last trials, newest last, ``(R, H, C)``; NaN
            where there is none.
    """

    config: WatchConfig
    past: np.ndarray

    @classmethod
    def fresh(cls, config: WatchConfig, runs: int, channels: int) -> "Detector":
        """A detector that has seen nothing."""
        return cls(config, np.full((runs, config.history, channels), np.nan))

    def update(self, innovations: np.ndarray) -> Alarms:
        """Judge a trial, and remember it.

        After an alarm a run begins anew: its robot is another one.

        Args:
            innovations: ``(R, C)``, positive; NaN where nothing was seen.
        """
        now = np.log(np.maximum(innovations, 1e-12))
        score = self._score(now)
        known = np.isfinite(score).any(1)
        filled = np.where(np.isfinite(score), score, -np.inf)
        suspect, worst = filled.argmax(1), filled.max(1)
        on = known & (worst >= self.config.threshold)
        self.past = np.concatenate([self.past[:, 1:], now[:, None]], axis=1)
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

    def _score(self, now: np.ndarray) -> np.ndarray:
        """Spreads above the median of the history, ``(R, C)``."""
        seen = np.isfinite(self.past)
        enough = seen.sum(1) >= self.config.warmup
        ordered = np.where(enough[:, None], self.past, 0.0)
        middle = np.nanmedian(ordered, axis=1)
        away = np.nanmedian(np.abs(ordered - middle[:, None]), axis=1)
        spread = np.maximum(NORMAL * away, FLOOR)
        return np.where(enough, (now - middle) / spread, np.nan)


def innovation(
    miss: np.ndarray, disagreement: np.ndarray, usual: np.ndarray
) -> np.ndarray:
    """Misses over what is to be expected, RMS over a trial's patterns.

    Args:
        miss: of each pattern and channel, ``(N, C)``.
        disagreement: variance of the ensemble's members, ``(N, C)``; 0 without one.
        usual: RMS error on the patterns trained on, ``(C,)``.

    Returns:
        ``(C,)``; NaN without patterns.
    """
    if not len(miss):
        return np.full(miss.shape[1], np.nan)
    expected = disagreement + np.maximum(usual, 1e-6) ** 2
    return np.sqrt(np.mean(miss**2 / expected, axis=0))
