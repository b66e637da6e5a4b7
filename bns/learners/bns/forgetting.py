"""Forgetting by evidence: drop what was learned of the robot before it changed.

An alternative to a sliding window, which forgets by age. Patterns of an old trial are
compared with the nearest ones of the newest trial, and what patterns of one trial
differ by among each other is the yardstick: their noise, and more with their distance.
The slope is that of both trials together; the noise that of the trial that has less, as
a wheel that stops now and then makes a trial differ from itself. So noise is no
contradiction, and neither is ground that the newest trial did not see. But a robot
changes at some time: what is older than a contradicted trial is of the robot before,
comparable or not, and goes with it.
"""

from typing import NamedTuple

import numpy as np

from bns.learners.bns.config import WatchConfig

KEPT = 0.9  # share of differences that count, the smallest; assumed


class Pairs(NamedTuple):
    """Patterns compared: squared distances ``(n,)``, squared differences ``(n, O)``."""

    far: np.ndarray
    apart: np.ndarray


class Law(NamedTuple):
    """Squares of what patterns of one robot differ by: noise + slope x distance^2."""

    noise: np.ndarray
    slope: np.ndarray

    def expected(self, far: np.ndarray) -> np.ndarray:
        """At squared distances ``(n,)``, of each output: ``(n, O)``."""
        found: np.ndarray = self.noise + self.slope * far[:, None]
        return found


def newer(trials: np.ndarray, gone: np.ndarray) -> int:
    """How many patterns of a run are left once its oldest trials are forgotten.

    Args:
        trials: the trial each pattern of the run is of, ``(N,)``.
        gone: the oldest of them, see `contradicted`.
    """
    return int((~np.isin(trials, gone)).sum())


def contradicted(
    inputs: np.ndarray,
    targets: np.ndarray,
    trials: np.ndarray,
    config: WatchConfig,
    usual: np.ndarray | None = None,
) -> np.ndarray:
    """Old trials of another robot: the last that the newest contradicts, and before.

    Args:
        inputs, targets: all patterns, scaled, ``(N, I)`` and ``(N, O)``.
        trials: the trial each pattern is of, ``(N,)``.
        config: thresholds.
        usual: the yardstick, ``(O,)``, where trials are too short to be compared with
            themselves: what SNNs usually err by; `targets` are their misses then,
            which change little over a distance. None: what a trial's patterns differ
            by among each other.

    Returns:
        Numbers of these trials, sorted.
    """
    if not len(trials):
        return np.empty(0, dtype=np.int64)
    newest = trials == trials.max()
    new, told = inputs[newest], targets[newest]
    known: Law | None = None
    if usual is None:
        own = [_within(new, told, config.forget_reach)]
    else:
        own, known = [], Law(usual**2, np.zeros_like(usual))
    old = np.unique(trials[~newest])
    for index in range(len(old))[::-1]:
        seen, was = inputs[trials == old[index]], targets[trials == old[index]]
        across = _across(seen, was, new, told, config.forget_reach)
        if len(across.far) < config.forget_least:
            continue
        law = known
        if law is None:
            law = _law([*own, _within(seen, was, config.forget_reach)], config)
        if law is not None and _differs(across, law, config):
            return old[: index + 1]
    return old[:0]


def _differs(across: Pairs, law: Law, config: WatchConfig) -> bool:
    """Whether patterns of two trials differ by more than those of one robot do."""
    usual = config.forget_factor**2 * law.expected(across.far)
    limit = np.maximum(usual, config.forget_floor**2)
    return bool((_smallest(across.apart / limit).mean(0) > 1.0).any())


def _law(trials: list[Pairs], config: WatchConfig) -> Law | None:
    """One slope for all trials, and the least noise; None: too few pairs.

    Args:
        trials: what patterns of each trial differ by among each other.
        config: its `forget_least` says how many pairs a trial needs to be heard.
    """
    told = [pairs for pairs in trials if len(pairs.far) >= config.forget_least]
    if not told:
        return None
    apart = np.concatenate([pairs.apart for pairs in told])
    far = np.concatenate([pairs.far for pairs in told])[:, None]
    kept = apart <= _smallest(apart).max(0)
    middle = (far * kept).sum(0) / kept.sum(0)
    aside = (far - middle) * kept
    slope = (aside * apart).sum(0) / np.maximum((aside**2).sum(0), 1e-12)
    slope = np.maximum(slope, 0.0)
    noises = [_smallest(p.apart - slope * p.far[:, None]).mean(0) for p in told]
    return Law(np.maximum(np.min(noises, axis=0), 0.0), slope)


def _within(inputs: np.ndarray, targets: np.ndarray, reach: float) -> Pairs:
    """All pairs of a trial's patterns that lie no further apart than `reach`."""
    one, other = np.triu_indices(len(inputs), 1)
    far = _squares(inputs, inputs)[one, other]
    near = far <= reach**2
    return Pairs(far[near], (targets[one[near]] - targets[other[near]]) ** 2)


def _across(
    seen: np.ndarray, was: np.ndarray, new: np.ndarray, told: np.ndarray, reach: float
) -> Pairs:
    """Each pattern of an old trial that has a near one in the newest, and that one."""
    square = _squares(seen, new)
    nearest = square.argmin(1)
    far = square[np.arange(len(seen)), nearest]
    near = far <= reach**2
    return Pairs(far[near], (was[near] - told[nearest[near]]) ** 2)


def _squares(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    square = (one**2).sum(1)[:, None] + (other**2).sum(1) - 2 * one @ other.T
    found: np.ndarray = np.maximum(square, 0.0)
    return found


def _smallest(values: np.ndarray) -> np.ndarray:
    """`KEPT` of each column."""
    count = max(1, int(np.ceil(KEPT * len(values))))
    return np.partition(values, count - 1, axis=0)[:count]
