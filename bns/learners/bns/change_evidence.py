"""Forgetting by evidence for walkers: has the robot changed since some trial?

Patterns of walking lie too far apart to be compared with their nearest neighbours, as
`forgetting` does. But two accounts of them can be weighed: one smooth function for all
trials, or one for the old and another for the new. A Gaussian process (Rasmussen and
Williams 2006, equation 2.30) predicts each new trial under either account, and the
difference of the log probabilities is the evidence for a change. On ground that the
old trials did not see, both predict alike.

Neither how well the networks are trained nor the usual error enters, so that a fresh
simulator is no change; and since the trial that says most does not count, nor is one
odd trial, such as a fall.

All numbers here were chosen on ten undamaged runs of 100 trials, where the evidence
never came above 4.
"""

import numpy as np

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
        told: outputs ``(N, O)``.
        scale: mean square of each output ``(O,)``.
    """
    root = np.linalg.cholesky(like)
    fresh = np.linalg.solve(root, told)
    spread = np.log(np.diag(root)) * told.shape[1] + np.log(scale).sum() / 2
    found: np.ndarray = -(fresh**2 / scale).sum(1) / 2 - spread
    return found
