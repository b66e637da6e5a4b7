"""Designs of comparisons: power, no difference shown, looks that share one level."""

from dataclasses import dataclass
from itertools import pairwise

import numpy as np
from scipy import special, stats

from bns.errors import BnsError
from bns.stats.measures import Sample, a12_error, a12_value

MARGIN = 0.14
"""less than what Vargha and Delaney (2000) call a medium effect, an A12 of 0.64"""


def equivalence(a: Sample, b: Sample, *, margin: float = MARGIN) -> float:
    """p of the larger of the two one-sided tests: small = alike.

    Args:
        a: values of one side; infinite ones rank as ties at the end.
        b: values of the other.
        margin: of A12 about one half, inside which sides count as alike.

    Raises:
        BnsError: a sample is empty or holds NaN, or a margin outside 0 to 0.5.
    """
    if not 0 < margin < 0.5:
        raise BnsError(
            f"A margin of {margin} is not allowed: give one between 0 and 0.5."
        )
    return of_share(a12_value(a, b), len(a), len(b), margin=margin)


def of_share(share: float, n_a: int, n_b: int, *, margin: float = MARGIN) -> float:
    """p of `equivalence` for a known A12.

    Args:
        share: the A12.
        n_a: runs on one side.
        n_b: runs on the other.
        margin: of A12 about one half.
    """
    low, high = 0.5 - margin, 0.5 + margin
    above = (share - low) / a12_error(low, n_a, n_b)
    below = (high - share) / a12_error(high, n_a, n_b)
    return float(special.ndtr(-min(above, below)))


LOOKS = (10, 20, 30, 50, 100)
"""runs a side"""


@dataclass(frozen=True)
class Design:
    """When runs are looked at.

    Attributes:
        looks: runs a side, growing.

    Raises:
        BnsError: looks that do not grow, or none.
    """

    looks: tuple[int, ...] = LOOKS

    def __post_init__(self) -> None:
        steps = [0, *self.looks]
        if not self.looks or any(a >= b for a, b in pairwise(steps)):
            raise BnsError(
                f"Looks at {self.looks} are not allowed: give numbers of runs that "
                "grow, as in (10, 20, 30)."
            )

    @property
    def shares(self) -> tuple[float, ...]:
        """The part of the level that each look spends; they add up to one."""
        steps = pairwise([0, *self.looks])
        return tuple((b - a) / self.looks[-1] for a, b in steps)

    def made(self, runs: int) -> tuple[int, ...]:
        """The looks that so many runs a side allow.

        Runs short of the first look count as that look.
        """
        return tuple(n for n in self.looks if n <= runs) or (runs,)

    def p(self, found: Sample) -> float:
        """The p of the sequence, from those of the looks made, in order."""
        spent = zip(found, self.shares, strict=False)
        return min(1.0, min(p / share for p, share in spent))


def up_to(runs: int) -> Design:
    """The design whose last look is at so many runs.

    Raises:
        BnsError: no runs.
    """
    return Design((*(n for n in LOOKS if n < runs), runs))


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
