"""What the benches of solving and recovering print of a record."""

import numpy as np

from bns import stats
from bns.experiment.record import RunRecord


def waits(values: np.ndarray) -> dict[str, object]:
    """Waiting times as figures: how many came, median, interval, longest.

    Args:
        values: trials, ``(R,)``; inf = never.
    """
    middle = stats.median_interval(values)
    come = np.isfinite(values)
    return {
        "came": int(come.sum()),
        "of": len(values),
        "median": plain(middle.value),
        "interval": [plain(middle.low), plain(middle.high)],
        "longest": plain(values[come].max()) if come.any() else None,
    }


def first(hit: np.ndarray) -> np.ndarray:
    """Number of the first trial that did it, counted from 1; inf = none, ``(R,)``."""
    return np.where(hit.any(1), hit.argmax(1) + 1.0, np.inf)


def solved_within(record: RunRecord, limit: int) -> int:
    """Runs that reached all objectives within `limit` trials."""
    return int((stats.trials_to_solve(record) <= limit).sum())


def recovered_within(record: RunRecord, limit: int) -> int:
    """Runs that reached all objectives within `limit` trials from the damage on."""
    return int((stats.trials_to_recover(record) <= limit).sum())


def versus(a: RunRecord, b: RunRecord) -> dict[str, object]:
    """O (eq 3.1: sum of the best controller's cost after damage) of two sides.

    Lower is better, so `better` is the share of pairs in which `a` is the lower one
    (1 - A12), with its interval.
    """
    first, second = stats.observation_after(a), stats.observation_after(b)
    share = stats.a12(second, first)
    return {
        "p": float(stats.mann_whitney(first, second)),
        "better": round(share.value, 4),
        "interval": [round(share.low, 4), round(share.high, 4)],
        "medians": [float(np.median(first)), float(np.median(second))],
    }


def ratio(first: np.ndarray, second: np.ndarray) -> dict[str, object]:
    """Median of one side over that of another, with its 95 % bootstrap interval.

    Args:
        first, second: values of two sides whose runs belong together, each ``(R,)``:
            pairs are drawn.
    """
    from scipy.stats import bootstrap

    def medians(one: np.ndarray, other: np.ndarray, axis: int = -1) -> np.ndarray:
        return np.median(one, axis=axis) / np.median(other, axis=axis)

    drawn = bootstrap((first, second), medians, paired=True, method="percentile", rng=0)
    ends = drawn.confidence_interval
    return {
        "ratio": round(float(medians(first, second)), 4),
        "ratio interval": [round(float(ends.low), 4), round(float(ends.high), 4)],
    }


def plain(value: float) -> float | None:
    """A number for JSON; None for never."""
    return float(value) if np.isfinite(value) else None
