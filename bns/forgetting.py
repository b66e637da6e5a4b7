"""Forgetting by evidence: drop the old trials that the newest one contradicts.

An alternative to a sliding window, which forgets by age. Patterns of an old trial are
compared with the nearest ones of the newest trial; what the patterns of either trial
differ by among each other, at their distances, is the yardstick, whichever is less: a
wheel that stops now and then makes the newest trial differ from itself as well. So
noise alone is no contradiction, and neither is ground that the newest trial did not
see.
"""

import numpy as np

from bns.config_watch import WatchConfig

FLOOR = 1e-3  # scaled outputs; differences below do not matter; assumed


def contradicted(
    inputs: np.ndarray,
    targets: np.ndarray,
    trials: np.ndarray,
    config: WatchConfig,
    usual: np.ndarray | None = None,
) -> np.ndarray:
    """Old trials that the newest one contradicts.

    Args:
        inputs, targets: all patterns, scaled, ``(N, I)`` and ``(N, O)``.
        trials: the trial each pattern is of, ``(N,)``.
        config: thresholds.
        usual: the yardstick, ``(O,)``, where trials are too short to be compared with
            themselves; None = what the patterns of a trial differ by.

    Returns:
        Numbers of these trials, sorted.
    """
    if not len(trials):
        return np.empty(0, dtype=np.int64)
    newest = trials == trials.max()
    new, told = inputs[newest], targets[newest]
    if len(new) < 2:
        return np.empty(0, dtype=np.int64)
    own = _scatter(new, told, config) if usual is None else usual
    if own is None:
        return np.empty(0, dtype=np.int64)
    found = []
    for trial in np.unique(trials[~newest]):
        seen, was = inputs[trials == trial], targets[trials == trial]
        rows, apart = _differences(seen, was, new, told, config.forget_reach)
        if len(rows) < config.forget_least:
            continue
        its = _scatter(seen[rows], was[rows], config) if usual is None else None
        least = own if its is None else np.minimum(own, its)
        least = np.maximum(least, FLOOR)
        if (_typical(apart) > config.forget_factor * least).any():
            found.append(trial)
    return np.array(found, dtype=np.int64)


def _scatter(
    inputs: np.ndarray, targets: np.ndarray, config: WatchConfig
) -> np.ndarray | None:
    """What patterns of a trial differ by among each other, ``(O,)``; None: too few."""
    reach = config.forget_reach
    rows, apart = _differences(inputs, targets, inputs, targets, reach, itself=True)
    return None if len(rows) < config.forget_least else _typical(apart)


def _differences(
    inputs: np.ndarray,
    targets: np.ndarray,
    new: np.ndarray,
    told: np.ndarray,
    reach: float,
    *,
    itself: bool = False,
) -> tuple[np.ndarray, np.ndarray]:
    """Patterns with a near one in the newest trial, and how far their outputs are off.

    Returns:
        indices ``(n,)``, absolute differences ``(n, O)``.
    """
    square = (inputs**2).sum(1)[:, None] + (new**2).sum(1) - 2 * inputs @ new.T
    if itself:
        np.fill_diagonal(square, np.inf)
    near = square.argmin(1)
    rows = np.flatnonzero(square[np.arange(len(inputs)), near] <= reach**2)
    return rows, np.abs(targets[rows] - told[near[rows]])


def _typical(apart: np.ndarray) -> np.ndarray:
    """RMS of differences, the largest tenth left out, ``(O,)``."""
    kept = np.sort(apart, axis=0)[: max(1, int(np.ceil(0.9 * len(apart))))]
    return np.sqrt(np.mean(kept**2, axis=0))
