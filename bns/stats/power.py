"""Power of the Mann-Whitney test: how often an effect of some size is detected.

Two normal distributions of equal spread whose A12 is given stand for the two sides.
The variance of U under such a shift is exact; U itself is taken as normal.
"""

import numpy as np
from scipy import special, stats

from bns.errors import BnsError

LEVEL = 0.05
MOST = 100_000


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


def runs_needed(a12: float, *, wanted: float = 0.8, level: float = LEVEL) -> float:
    """Runs a side for a power; infinite where no number up to 100,000 is enough.

    Args:
        a12: probability that a value of one side is larger than one of the other.
        wanted: power that is to be reached, 0 to 1.
        level: of significance.

    Raises:
        BnsError: an A12 outside 0 to 1.
    """
    if power(a12, MOST, MOST, level=level) < wanted:
        return float("inf")
    low, high = 1, MOST
    while low < high:
        middle = (low + high) // 2
        if power(a12, middle, middle, level=level) >= wanted:
            high = middle
        else:
            low = middle + 1
    return float(low)


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
