"""How far a robot's motion scatters by itself, from repeats of the same commands.

Restricted maximum likelihood (Patterson and Thompson 1971) with the covariance that
whitens residuals: noise of the measurement, which neighbouring windows share, and
scatter that grows with time. Scatter adds up over a trial and noise does not, so whole
trials tell them apart far better than windows one by one.
"""

from collections.abc import Sequence

import numpy as np
from scipy.linalg import cho_factor, cho_solve
from scipy.optimize import minimize

from bns.gap.models.base import Windows

LEAST, MOST = 1e-3, 1e3  # of the model's own scatter, between which it is looked for


def scatter(
    values: Sequence[np.ndarray],
    noise: Sequence[np.ndarray],
    windows: Sequence[Windows],
    usual: np.ndarray,
) -> np.ndarray:
    """Scatter of the motion per square root of a second, by feature.

    Args:
        values: per group of repeats their features, ``(R, W, C)``; windows in which one
            of them is not finite are left out.
        noise: per group the covariance of the features' noise, ``(W * C, W * C)``.
        windows: per group, W.
        usual: scatter to start from, ``(C,)``.

    Returns:
        ``(C,)``, within `LEAST` and `MOST` of the usual one.
    """
    groups = [
        _group(seen, covariance, parts.durations)
        for seen, covariance, parts in zip(values, noise, windows, strict=True)
    ]
    groups = [group for group in groups if group[0].size]
    if not groups:
        return usual

    def misfit(logarithms: np.ndarray) -> float:
        own = (usual * np.exp(logarithms)) ** 2
        return sum(_misfit(*group, own) for group in groups)

    bounds = [(np.log(LEAST), np.log(MOST))] * len(usual)
    starts = (np.zeros(len(usual)), np.full(len(usual), np.log(LEAST) / 2))
    found = [
        minimize(misfit, start, method="L-BFGS-B", bounds=bounds) for start in starts
    ]
    return usual * np.exp(min(found, key=lambda item: item.fun).x)


def _group(
    seen: np.ndarray, covariance: np.ndarray, durations: np.ndarray
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Departures from the mean ``(W * C, R)``, covariance and durations, all finite."""
    kept = np.isfinite(seen).all(axis=(0, 2))
    flat = np.repeat(kept, seen.shape[2])
    apart = (seen - seen.mean(axis=0))[:, kept].reshape(len(seen), -1).T
    return apart, covariance[np.ix_(flat, flat)], durations[kept]


def _misfit(
    apart: np.ndarray, covariance: np.ndarray, durations: np.ndarray, own: np.ndarray
) -> float:
    """Minus twice the restricted log-likelihood, but for a constant."""
    whole = covariance + np.diag(np.outer(durations, own).ravel())
    factor = cho_factor(whole, lower=True)
    spread = 2 * np.log(np.diag(factor[0])).sum()
    degrees = apart.shape[1] - 1
    return float(degrees * spread + (apart * cho_solve(factor, apart)).sum())
