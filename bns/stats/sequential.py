"""Looks at runs while they come, with the level spent over the looks.

A comparison is looked at after 10, 20, 30, 50 and 100 runs a side and may stop at each.
The level is spent in proportion to the runs that each look adds: a tenth of it at 10,
20 and 30 runs, a fifth at 50, half at 100. What is spent adds up to the level, so by
the union bound the chance to find a difference where there is none stays below it,
however the looks hang together: with ties, with runs that never get there, with pairs.
(O'Brien and Fleming's or Pocock's boundaries for joint normal looks spend a little less
at the end; they hold for large samples without ties.)

The p of the whole sequence is the smallest level at which any look made would have
stopped: the least of each look's p over its share. It is a p like any other, valid
wherever one stops, and may be adjusted by Holm's method with others.
"""

from dataclasses import dataclass
from itertools import pairwise

from bns.errors import BnsError
from bns.stats.measures import Sample

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
