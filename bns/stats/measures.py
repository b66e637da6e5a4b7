"""Statistics of runs: the dissertation's test, effect size, intervals, milestones.

Definitions, all counting trials from 1:

*Solved* at the first trial in which all objectives are reached. *Recovered* at the
first trial, counted from the onset of damage (the onset trial is 1), in which all
objectives are reached in the damaged world. Infinite where it never happens.
"""

from collections.abc import Sequence
from typing import NamedTuple, TypeAlias

import numpy as np
from scipy import special, stats

from bns import seeding
from bns.errors import BnsError
from bns.experiment.record import RunRecord

Sample: TypeAlias = Sequence[float] | np.ndarray
"""numbers, ``(n,)``"""


CONFIDENCE = 0.95
RESAMPLES = 2000


class Interval(NamedTuple):
    """An estimate with its confidence interval."""

    value: float
    low: float
    high: float


def mann_whitney(a: Sample, b: Sample) -> float:
    """Two-sided Mann-Whitney p by the normal approximation, continuity corrected.

    Reproduces the dissertation's tables. Infinite values rank as ties at the end.

    Raises:
        BnsError: a sample is empty or holds NaN.
    """
    one, other = _sample(a), _sample(b)
    if (np.concatenate([one, other]) == one[0]).all():
        return 1.0  # nothing to rank
    return float(
        stats.mannwhitneyu(
            one,
            other,
            method="asymptotic",
            use_continuity=True,
            alternative="two-sided",
        ).pvalue
    )


def p_of_u(u: float, n_a: int, n_b: int) -> float:
    """The p of `mann_whitney` for a known U without ties.

    Args:
        u: statistic of either sample, 0 to ``n_a * n_b``.
        n_a: size of one sample.
        n_b: size of the other.
    """
    spread = np.sqrt(n_a * n_b * (n_a + n_b + 1) / 12)
    z = (abs(u - n_a * n_b / 2) - 0.5) / spread
    return float(min(1.0, 2 * special.ndtr(-z)))


def holm(p: Sample) -> np.ndarray:
    """p values adjusted for their number by Holm's step-down method, in order.

    Args:
        p: of n tests.

    Returns:
        ``(n,)``, 1 at most.
    """
    given = np.asarray(p, dtype=np.float64)
    order = np.argsort(given, kind="stable")
    factors = len(given) - np.arange(len(given))
    adjusted = np.empty_like(given)
    adjusted[order] = np.minimum(1.0, np.maximum.accumulate(given[order] * factors))
    return adjusted


def a12(a: Sample, b: Sample, *, confidence: float = CONFIDENCE) -> Interval:
    """Vargha and Delaney's A12 with Newcombe's interval.

    A12 is the probability that a value of `a` is larger than one of `b`, ties counted
    half. The interval is method 5 of Newcombe (2006, Statistics in Medicine 25,
    559-573): the score-like form of Hanley and McNeil's variance, which stays inside
    0 to 1 and keeps its coverage near the ends, where DeLong's collapses.

    Raises:
        BnsError: a sample is empty or holds NaN.
    """
    value = a12_value(a, b)
    z = special.ndtri(0.5 + confidence / 2)
    low = _newcombe(value, len(a), len(b), z, upper=False)
    high = _newcombe(value, len(a), len(b), z, upper=True)
    return Interval(value, low, high)


def a12_value(a: Sample, b: Sample) -> float:
    """A12 without its interval.

    Raises:
        BnsError: a sample is empty or holds NaN.
    """
    one, other = _sample(a), _sample(b)
    ranks = stats.rankdata(np.concatenate([one, other]))[: len(one)]
    u = ranks.sum() - len(one) * (len(one) + 1) / 2
    return float(u / (len(one) * len(other)))


def a12_error(theta: float, n_a: int, n_b: int) -> float:
    """Standard error of A12 where it is `theta`, without ties (Newcombe's method 5)."""
    mean = (n_a + n_b) / 2 - 1
    shape = (1 - theta) / (2 - theta) + theta / (1 + theta)
    return float(np.sqrt(theta * (1 - theta) * (1 + mean * shape) / (n_a * n_b)))


def median_interval(values: Sample, *, confidence: float = CONFIDENCE) -> Interval:
    """The median and its exact interval from order statistics.

    The interval reaches from the k-th smallest to the k-th largest value, k the
    largest for which the binomial guarantees the confidence whatever the
    distribution; too few values give an infinite one. Infinite values are allowed.

    Raises:
        BnsError: no values, or NaN among them.
    """
    ordered = np.sort(_sample(values))
    n = len(ordered)
    k = int(stats.binom.ppf((1 - confidence) / 2, n, 0.5))
    bounds = (ordered[k - 1], ordered[n - k]) if k >= 1 else (-np.inf, np.inf)
    return Interval(median(ordered), float(bounds[0]), float(bounds[1]))


def median(values: Sample) -> float:
    """The median; infinite values are allowed (never = inf, half never = inf)."""
    ordered = np.sort(_sample(values))
    low, high = ordered[(len(ordered) - 1) // 2], ordered[len(ordered) // 2]
    return float(low if low == high else (low + high) / 2)


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


def bootstrap_median(values: Sample, *, confidence: float = CONFIDENCE) -> Interval:
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


def trials_to_solve(record: RunRecord) -> np.ndarray:
    """Trials until all objectives were first reached, ``(R,)``; inf = never."""
    return _first(record["solved"] > 0)


def trials_to_recover(record: RunRecord) -> np.ndarray:
    """Trials from the onset of damage until all objectives were reached again.

    Shape ``(R,)``; 1 = in the onset trial itself, inf = never, NaN = no damage in the
    trials done.
    """
    onset = record.damage_onset[:, None]
    trial = np.arange(record.trials)[None]
    first = _first((record["solved"] > 0) & (trial >= onset))
    hit = (record.damage_onset >= 0) & (record.damage_onset < record.trials)
    return np.where(hit, first - record.damage_onset, np.nan)


def observation_after(record: RunRecord) -> np.ndarray:
    """The sum of the best individual's cost over the trials from the onset on.

    Equation 3.1 of the dissertation, shape ``(R,)``; lower is better. Without damage
    it runs over all trials; NaN where damage comes after the trials done.
    """
    onset = np.maximum(record.damage_onset, 0)[:, None]
    trial = np.arange(record.trials)[None]
    total = np.where(trial >= onset, record["fitness_best"], 0.0).sum(axis=1)
    return np.where(onset[:, 0] < record.trials, total, np.nan)


def _first(hit: np.ndarray) -> np.ndarray:
    """1-based index of the first True along axis 1; inf = none."""
    if hit.shape[1] == 0:
        return np.full(len(hit), np.inf)
    return np.where(hit.any(axis=1), hit.argmax(axis=1) + 1.0, np.inf)


def _sample(values: Sample) -> np.ndarray:
    sample = np.asarray(values, dtype=np.float64)
    if sample.ndim != 1 or len(sample) == 0 or np.isnan(sample).any():
        raise BnsError(
            f"A sample of shape {sample.shape} with {np.isnan(sample).sum()} NaN "
            "cannot be compared: give a list of numbers, at least one."
        )
    return sample


def _newcombe(value: float, n_a: int, n_b: int, z: float, *, upper: bool) -> float:
    """The limit: where `value` is z standard errors away, found by bisection."""
    inside, outside = value, 1.0 if upper else 0.0
    for _ in range(60):
        middle = (inside + outside) / 2
        if abs(middle - value) <= z * a12_error(middle, n_a, n_b):
            inside = middle
        else:
            outside = middle
    return outside if outside in (0.0, 1.0) else inside
