"""Exact Gaussian process regression with a Matern 5/2 kernel.

Rasmussen and Williams (2006), equations 2.25, 2.26 and 4.17.
"""

import numpy as np


def matern(one: np.ndarray, other: np.ndarray, reach: float) -> np.ndarray:
    """Correlation of points, 1 at no distance.

    Args:
        one: ``(N, B)``.
        other: ``(M, B)``.
        reach: length scale.

    Returns:
        ``(N, M)``.
    """
    square = (one**2).sum(1)[:, None] + (other**2).sum(1) - 2 * one @ other.T
    far = np.sqrt(5.0 * np.maximum(square, 0.0)) / reach
    found: np.ndarray = (1.0 + far + far**2 / 3.0) * np.exp(-far)
    return found


def posterior(
    known: np.ndarray,
    values: np.ndarray,
    wanted: np.ndarray,
    *,
    reach: float,
    noise: float,
) -> tuple[np.ndarray, np.ndarray]:
    """What a process of mean 0 and variance 1 is elsewhere, some values known.

    Args:
        known: where they are known, ``(N, B)``; the same place may be there twice.
        values: ``(N,)``.
        wanted: where it is asked for, ``(M, B)``.
        reach: length scale.
        noise: variance of what is seen about the process.

    Returns:
        mean and standard deviation, each ``(M,)``.
    """
    if not len(known):
        return np.zeros(len(wanted)), np.ones(len(wanted))
    like = matern(known, known, reach) + noise * np.eye(len(known))
    across = matern(known, wanted, reach)
    root = np.linalg.cholesky(like)
    told = np.linalg.solve(root, values)
    seen = np.linalg.solve(root, across)
    left = np.maximum(1.0 - (seen**2).sum(0), 0.0)
    return seen.T @ told, np.sqrt(left)
