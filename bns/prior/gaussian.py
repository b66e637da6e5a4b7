"""Exact Gaussian process regression.

Rasmussen and Williams (2006), equations 2.25, 2.26, 4.9 and 4.17.
"""

from collections.abc import Callable

import numpy as np

Kernel = Callable[[np.ndarray, np.ndarray, float], np.ndarray]


def matern(one: np.ndarray, other: np.ndarray, reach: float) -> np.ndarray:
    """Matern 5/2 correlation of points, 1 at no distance.

    Args:
        one: ``(N, B)``.
        other: ``(M, B)``.
        reach: length scale.

    Returns:
        ``(N, M)``.
    """
    far = np.sqrt(5.0 * _square(one, other)) / reach
    found: np.ndarray = (1.0 + far + far**2 / 3.0) * np.exp(-far)
    return found


def exponential(one: np.ndarray, other: np.ndarray, reach: float) -> np.ndarray:
    """Squared exponential correlation of points, 1 at no distance.

    Args:
        one: ``(N, B)``.
        other: ``(M, B)``.
        reach: length scale.

    Returns:
        ``(N, M)``.
    """
    found: np.ndarray = np.exp(-0.5 * _square(one, other) / reach**2)
    return found


def _square(one: np.ndarray, other: np.ndarray) -> np.ndarray:
    """Squares of the distances, ``(N, M)``."""
    square = (one**2).sum(1)[:, None] + (other**2).sum(1) - 2 * one @ other.T
    return np.maximum(square, 0.0)


def posterior(
    known: np.ndarray,
    values: np.ndarray,
    wanted: np.ndarray,
    *,
    reach: float,
    noise: float,
    kernel: Kernel = matern,
) -> tuple[np.ndarray, np.ndarray]:
    """What a process of mean 0 and variance 1 is elsewhere, some values known.

    Args:
        known: where they are known, ``(N, B)``; the same place may be there twice.
        values: ``(N,)``; or ``(N, Q)``, Q processes known at the same places.
        wanted: where it is asked for, ``(M, B)``.
        reach: length scale.
        noise: variance of what is seen about the process.
        kernel: how alike the process is at two places.

    Returns:
        mean, ``(M,)`` or ``(M, Q)``, and standard deviation, ``(M,)``.
    """
    if not len(known):
        return np.zeros((len(wanted), *values.shape[1:])), np.ones(len(wanted))
    like = kernel(known, known, reach) + noise * np.eye(len(known))
    across = kernel(known, wanted, reach)
    root = np.linalg.cholesky(like)
    told = np.linalg.solve(root, values)
    seen = np.linalg.solve(root, across)
    left = np.maximum(1.0 - (seen**2).sum(0), 0.0)
    return seen.T @ told, np.sqrt(left)
