"""Whether two samples are alike: two one-sided tests on A12 with a stated margin.

A large p of a test for difference shows nothing. Here the null hypothesis is that A12
lies at least `margin` from one half; it is refused from both sides or not at all
(Schuirmann 1987, Journal of Pharmacokinetics and Biopharmaceutics 15, 657-680). The
standard error is that of `bns.stats.a12`'s interval, at the edge of the margin, so a p
below 0.05 says that the 90 % interval lies inside the margin. Ties make the error of
A12 smaller than this one: with many of them the test is careful.
"""

from scipy import special

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
