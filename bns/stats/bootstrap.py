"""Bootstrap intervals, seeded: the same values give the same interval."""

import numpy as np

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
