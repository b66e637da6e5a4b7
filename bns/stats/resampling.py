"""Bootstrap intervals of a median, and the power of a comparison."""

import numpy as np
from scipy import special, stats

from bns import seeding
from bns.errors import BnsError
from bns.stats import CONFIDENCE, Interval
from bns.stats.measures import Sample

RESAMPLES = 2000


def median_band(
    values: np.ndarray, *, confidence: float = CONFIDENCE, resamples: int = RESAMPLES
) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Median over runs with its percentile bootstrap interval, per column.

    The interval is pointwise: it holds for each column, not for all of them at once.

    Args:
        values: ``(R, T)``; infinite values are allowed (never = inf).
        confidence: of the interval, for each column by itself.
        resamples: bootstrap samples.

    Returns:
        median, low and high, each ``(T,)``.

    Raises:
        BnsError: no runs, or NaN among the values.
    """
    values = np.asarray(values, dtype=np.float64)
    if values.ndim != 2 or len(values) == 0 or np.isnan(values).any():
        raise BnsError(
            f"Values of shape {values.shape} with {np.isnan(values).sum()} NaN have no "
            "median: give runs times columns, at least one run."
        )
    runs = len(values)
    rng = seeding.generator(0, "bootstrap", runs, values.shape[1])
    drawn = np.sort(rng.integers(runs, size=(resamples, runs)), axis=1)
    # a resample of sorted values is sorted, so its medians stand in its middle
    ordered = np.sort(values, axis=0)
    lower, upper = drawn[:, (runs - 1) // 2], drawn[:, runs // 2]
    medians = np.sort(_middle(ordered[lower], ordered[upper]), axis=0)
    tail = (1 - confidence) / 2
    low = medians[int(np.floor(tail * (resamples - 1)))]
    high = medians[int(np.ceil((1 - tail) * (resamples - 1)))]
    centre = _middle(ordered[(runs - 1) // 2], ordered[runs // 2])
    return centre, low, high


def median(values: Sample, *, confidence: float = CONFIDENCE) -> Interval:
    """The median of values with its percentile bootstrap interval; see `median_band`.

    Raises:
        BnsError: no values, or NaN among them.
    """
    column = np.asarray(values, dtype=np.float64)[:, None]
    return Interval(*(float(x[0]) for x in median_band(column, confidence=confidence)))


def _middle(low: np.ndarray, high: np.ndarray) -> np.ndarray:
    """Half way; infinite where either is."""
    with np.errstate(invalid="ignore"):
        return np.where(low == high, low, (low + high) / 2)


LEVEL = 0.05


def power(a12: float, n_a: int, n_b: int, *, level: float = LEVEL) -> float:
    """Probability that two-sided p < level.

    Args:
        a12: probability that a value of one side is larger than one of the other.
        n_a: runs on one side.
        n_b: runs on the other.
        level: of significance.

    Raises:
        BnsError: an A12 outside 0 to 1, or a side without runs.
    """
    if not 0 <= a12 <= 1 or n_a < 1 or n_b < 1:
        raise BnsError(
            f"A12 = {a12} with {n_a} and {n_b} runs has no power: give an A12 from 0 "
            "to 1 and at least one run a side."
        )
    theta = max(a12, 1 - a12)
    null = np.sqrt(n_a * n_b * (n_a + n_b + 1) / 12)
    spread = np.sqrt(_variance(theta, n_a, n_b))
    gap = n_a * n_b * (theta - 0.5) - 0.5  # continuity correction, as in the test
    reach = special.ndtri(1 - level / 2) * null
    if spread == 0:
        return float(gap > reach)
    far = special.ndtr((gap - reach) / spread)
    near = special.ndtr((-gap - 1 - reach) / spread)
    return float(np.clip(far + near, 0.0, 1.0))


def _variance(theta: float, n_a: int, n_b: int) -> float:
    """Variance of U for normal sides shifted to A12 = theta."""
    if theta >= 1:
        return 0.0
    point = special.ndtri(theta)
    # two values of one side against one of the other: normal, correlation 1/2
    both = float(
        stats.multivariate_normal(cov=[[1, 0.5], [0.5, 1]]).cdf([point, point])
    )
    pairs = theta * (1 - theta) + (n_a + n_b - 2) * (both - theta**2)
    return max(0.0, n_a * n_b * pairs)
