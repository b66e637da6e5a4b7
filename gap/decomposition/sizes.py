"""How large a gap is beyond what measuring scatters, and what explanations leave."""

from dataclasses import dataclass

import numpy as np

from bns.gap.decomposition import rest, shares
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.shares import HeldOut

WITHIN = 0.1  # of what explanations leave: all but that is within the model's slack
ALONE = 0.1  # of the floor's variance, of one of many features; the others show no gap
TENTH = 0.1  # of what scatters: explanations that take less of it off take next to none


@dataclass(frozen=True, eq=False)
class Sizes:
    """How large a gap is, and what a point leaves of it; see `Decomposition`.

    Attributes:
        inside: what counts, ``(N, C)``.
        plain: what the point leaves, its slack taken, ``(N, C)``.
        strayed: windows of trials that went another way than their repeats, ``(N,)``.
        before, after: variances of the floor, of the nominal model and of the point.
        scatter: the same of what differs between repeats.
    """

    inside: np.ndarray
    strayed: np.ndarray
    plain: np.ndarray
    before: float
    after: float
    scatter: float

    @classmethod
    def of(
        cls, problem: Problem, start: Point, point: Point, known: rest.Floor
    ) -> "Sizes":
        """Of a point, beside the nominal model.

        Args:
            problem: the recording.
            start: the nominal model.
            point: a fitted set.
            known: the floor.
        """
        linear = point.linear
        full = linear.rest(linear.solve(linear.free))
        inside = rest.kept(problem, full, point.noise.sd)
        strayed = rest.strayed(problem, point.rest, known)
        inside &= ~strayed[:, None]
        plain, slack = point.rest, linear.solve(point.support)
        if not point.noise.memory.factors.size:
            plain = linear.rest(slack)
        else:  # under a memory of residuals slack takes too much, unless it is all
            within = HeldOut.of(problem, point).plain.rest(slack)
            sizes = [rest.excess(x, known, inside) for x in (within, plain)]
            plain = within if sizes[0] < WITHIN * sizes[1] else plain
        return cls(
            inside,
            strayed,
            plain,
            before=rest.excess(start.rest, known, inside),
            after=rest.excess(plain, known, inside),
            scatter=rest.scattered(problem, plain, known, inside),
        )

    @property
    def unexplained(self) -> float:
        """Share of the gap that is left and is not what differs between repeats."""
        return share(self.after - self.scatter, self.before, self.after)

    def foretells_worse(self, problem: Problem, start: Point, point: Point) -> bool:
        """Whether explanations foretell motion that was not fitted worse than the
        nominal model does: they describe the recording, not the robot.

        Args:
            problem: the recording.
            start: the nominal model.
            point: a fitted set.
        """
        held = HeldOut.of(problem, point, shares.PIECES, self.inside)
        none, some = held.compared(start.rest, point.support)
        return some > none

    def unseen(self, start: Point, point: Point, known: rest.Floor) -> bool:
        """Whether no gap shows beyond the floor in any feature, and explanations leave
        most of what scatters once all that is not known of trials is taken out: there
        is nothing to explain.

        Args:
            start: the nominal model.
            point: a fitted set.
            known: the floor.
        """
        if self.before > 0 or rest.most(start.rest, known, self.inside) > ALONE:
            return False
        none, some = (point.linear.squares(s) for s in ((), point.support))
        return bool(none - some < TENTH * none)


def share(size: float, before: float, after: float) -> float:
    """An excess over the floor as a share of the gap, the larger of what was there
    before and after the fit.

    Args:
        size: the excess.
        before, after: of the nominal model, and of what a fit leaves.
    """
    return max(size, 0.0) / max(before, after, 1e-9)


def worse(problem: Problem, start: Point, point: Point, known: rest.Floor) -> bool:
    """Whether explanations make the plain error larger: an autoregression may like
    what predictions do not.

    Args:
        problem: the recording.
        start: the nominal model.
        point: a fitted set.
        known: the floor.
    """
    every = problem.seen
    return bool(point.support) and rest.excess(point.rest, known, every) > rest.excess(
        start.rest, known, every
    )
