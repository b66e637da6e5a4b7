"""What the joint fit found in a recording."""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from functools import cached_property

import numpy as np

from bns.gap.decomposition import (
    descent,
    fit,
    flexible,
    onset,
    refit,
    rest,
    shares,
    simpler,
    starts,
    ties,
)
from bns.gap.decomposition.evidence.linear import Support
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.onset import Onset
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.decomposition.shares import HeldOut, Part
from bns.gap.decomposition.singles import Singles
from bns.gap.decomposition.sizes import Sizes, share, worse
from bns.progress import Tell, unheard

MOST = 0.5  # share of the gap beyond which what is left is most of it
PINNED = 0.15  # the same where an explanation ended at the edge of what is possible
EDGE = 0.01  # plausible departures from a bound that are at it
FELT = 0.02  # of the floor's variance: a gap below shows in no picture
LARGE = 2.0  # variances of the floor: more than heavy tails of any camera's noise
SCATTER = 3.0  # times what differs between repeats
BEYOND_LATE = 25.0  # variances of the floor: five times as large as all it scatters
BROKEN = 0.05  # of its motion: no sound robot scatters by as much (assumed)


@dataclass(frozen=True, eq=False)
class Decomposition:
    """What the joint fit found.

    Attributes:
        problem: the recording; split where something sets in.
        start: the nominal model.
        point: the explanations, fitted.
        parts: their shares, the largest first.
        tied: sets that the data cannot tell from the one of `point`, itself first.
        onset: what sets in; None = nothing.
        floor: what measuring scatters.
        before, after: excess over the floor of the nominal model and of `point`.
        beyond: the same of `point`, less what a simulation is exact to in each feature.
        recurs: standard errors by which what `point` leaves recurs.
        scatter: excess over the floor of what differs between repeats.
        moved: mean square of the recorded motion in units of the floor.
        inside: which residuals count, ``(N, C)``: no wild points, no strayed trial.
        unstable: numbers of trials that may go anywhere, and are not fitted.
        strayed: numbers of trials that went another way than their repeats.
        goes: with what the gap goes where its explanations only imitate its cause, in
            words; "" = they do not (`flexible.imitated`).
        unconfirmed: explanations that one trial alone shows, and its number; they are
            not in `point`.
        searched: whether what the robot's description does not list was tried as well
            (`diagnosis.widened`).
        unlisted: the decomposition with that, where it explains what this one leaves.
    """

    problem: Problem
    start: Point
    point: Point
    parts: tuple[Part, ...]
    tied: tuple[Support, ...]
    onset: Onset | None
    floor: rest.Floor
    before: float
    after: float
    beyond: float
    recurs: float
    scatter: float
    moved: float
    inside: np.ndarray
    unstable: tuple[int, ...] = ()
    strayed: tuple[int, ...] = ()
    goes: str = ""
    unconfirmed: Mapping[str, int] = field(default_factory=dict)
    searched: bool = False
    unlisted: "Decomposition | None" = None

    @cached_property
    def closed(self) -> float:
        """Share that is closed on stretches that were not fitted, of what can be
        closed: down to what measuring scatters, or where the rest is no more than
        scatter to what all explanations together leave."""
        problem, point = self.problem, self.point
        if not point.support:
            return 0.0
        held = HeldOut.of(problem, point, shares.PIECES, self.inside)
        none, some = held.compared(self.start.rest, point.support)
        least = held.floor(self.floor.sd, some)
        if not self.lasting:
            least = held.error(point.linear.free).sum()
        return float((none - some) / max(none - min(least, some), 1e-9))

    @property
    def left(self) -> float:
        """Share of the gap that is left."""
        return share(self.after, self.before, self.after)

    @property
    def recurring(self) -> bool:
        """Whether the rest is the same whenever the motion is."""
        return self.recurs > rest.SURE

    @property
    def broken(self) -> bool:
        """Whether the rest is more than a sound robot may scatter."""
        large = np.sqrt(max(self.after, 0.0) / self.moved) > BROKEN
        return bool(large and self.after > LARGE)

    @property
    def unexplained(self) -> float:
        """Share of the gap that is left and is not what differs between repeats."""
        apart = 0.0 if self.broken else self.scatter
        return share(self.after - apart, self.before, self.after)

    @property
    def lasting(self) -> bool:
        """Whether the rest is more than scatter and than how exact a simulation is.

        It recurs, or it is far beyond what measuring scatters and what differs between
        repeats, or beyond what a sound robot may scatter (what happens at one place, or
        by chance).
        """
        if self.broken:
            return True
        if self.after <= self.scatter:
            return False
        if self.recurring:
            return self.beyond > FELT
        return self.beyond > max(LARGE, SCATTER * self.scatter)

    @property
    def failing(self) -> bool:
        """Whether most of a large gap stays on motion that was not fitted: what was
        found describes the recording, not the robot."""
        large = bool(self.point.support) and self.before > LARGE
        return large and self.closed < 1 - MOST

    @property
    def strained(self) -> bool:
        """Whether much is left although an explanation ended at the edge of what is
        possible: it bends to something else."""
        if not self.lasting or self.unexplained < PINNED:
            return False
        low, high = self.problem.bounds
        rows, values = self.problem.rows, self.point.values
        edge = np.minimum(values - low, high - values) < EDGE * self.problem.sd
        off = np.abs(values - self.problem.nominal) > self.problem.sd
        smooth = np.array([r.smooth and r.term in self.point.support for r in rows])
        return bool((edge & off & smooth).any())

    @property
    def foreign(self) -> bool:
        """Whether the library lacks what most of the gap comes from: of one of which
        nothing is explained, of what recurs of it."""
        most = self.lasting and self.unexplained > MOST
        if not self.point.support and self.lasting and self.recurring:
            most |= self.after - self.scatter > LARGE
        alone = bool(self.unconfirmed) and not self.point.support
        other = bool(self.goes or self.elsewhere)
        return most or alone or self.failing or self.strained or other

    @property
    def elsewhere(self) -> frozenset[str]:
        """Explanations that the description does not list, unless they stand beside
        those that it does."""
        other, named = self.unlisted, self.point.support
        if other is None or (named and named <= other.point.support):
            return frozenset()
        return other.point.support - self.problem.terms.keys()

    @property
    def told(self) -> "Decomposition":
        """The one whose explanations, shares and figures are told: with what the
        description does not list, where that is what most of the gap comes from."""
        return self.unlisted if self.unlisted and self.elsewhere else self

    @property
    def kind(self) -> str:
        """Kind of the verdict, one of `records.KINDS`."""
        if self.foreign:
            return "none of the library"
        if not self.point.support:
            return "no gap"
        if len(self.tied) > 1:
            return "either"
        return "effect" if len(self.point.support) == 1 else "together"


def decompose(
    problem: Problem, *, seed: int = 0, tell: Tell = unheard
) -> Decomposition:
    """Fit, date, guard against what makes held-out errors worse, and weigh the rest.

    Args:
        problem: the recording.
        seed: of the noise that measures the floor.
        tell: is told when a stage begins (`bns.gap.stages`).
    """
    problem, start, known, unstable = _steady(problem, seed)
    tell("explanations")
    tried = Singles(problem, start)
    problem, point = descent.beside(problem, starts.explained(tried))
    found = onset.dated(problem, start, point)
    late = None
    if found:
        problem, point, late = found
    problem, point, size, unconfirmed = _settled(problem, start, point, known)
    if late and late.name not in point.support:
        late = None
    moved = problem.model.travelled(problem.recorded)
    tell("rivals")
    made = Decomposition(
        problem=problem,
        start=start,
        point=point,
        parts=(),
        tied=tuple(ties.tied(problem, point, tried)),
        onset=late,
        floor=known,
        before=size.before,
        after=size.after,
        beyond=rest.beyond(size.plain, moved, known, size.inside, Row.inexact),
        recurs=_recurs(problem, point, size.plain),
        scatter=size.scatter,
        moved=max(rest.excess(moved, known, size.inside), 1.0),
        inside=size.inside,
        unstable=_numbers(problem, unstable),
        strayed=_numbers(problem, size.strayed),
        goes=flexible.imitated(problem, start.rest, point.rest, known, size.inside)
        if point.support
        else "",
        unconfirmed=unconfirmed,
    )
    parts = shares.parts(problem, point, lasting=made.lasting)
    return replace(made, parts=tuple(parts))


def _recurs(problem: Problem, point: Point, plain: np.ndarray) -> float:
    """Standard errors by which what a point leaves, ``(N, C)``, recurs."""
    left = point.linear.rest(point.linear.solve(point.support))
    piece = rest.SHORT if point.noise.order else rest.PIECE
    within = rest.recurrence(problem, left, point.noise.sd, piece=piece)
    return max(within, rest.repeated(problem, plain))


def _settled(
    problem: Problem, start: Point, point: Point, known: rest.Floor
) -> tuple[Problem, Point, Sizes, dict[str, int]]:
    """A point without explanations that nothing confirms, that make held-out errors
    worse, that are no gap, or that close hardly any of it; the problem that takes some
    of these as slack; the sizes; and what one trial alone shows (`unconfirmed`)."""
    unconfirmed = shares.unconfirmed(problem, point)
    support = shares.departing(problem, point) - unconfirmed.keys()
    if support != point.support:
        point = refit.refitted(problem, point, support)
    support = shares.guarded(problem, point)
    if support != point.support:
        point = refit.refitted(problem, point, support)
    loose = shares.within_slack(problem, point)
    if loose is not problem:
        slack = {
            row.term for row in loose.rows if row.unsure and row.slack == row.unsure
        }
        problem, point = loose, refit.refitted(loose, point, point.support - slack)
    if worse(problem, start, point, known):
        point = refit.refitted(problem, point, frozenset())
    point, size = _weighed(problem, start, point, known)
    other = simpler.renamed(problem, point)
    if other is not point:  # what stood beside another one may go
        point, size = _weighed(problem, start, other, known)
    unseen = size.unseen(start, point, known)
    if point.support and (unseen or size.foretells_worse(problem, start, point)):
        point = refit.refitted(problem, point, frozenset())
        size = Sizes.of(problem, start, point, known)
    return problem, point, size, unconfirmed


def _weighed(
    problem: Problem, start: Point, point: Point, known: rest.Floor
) -> tuple[Point, Sizes]:
    """A point without what closes hardly any of the gap, and the sizes."""
    size = Sizes.of(problem, start, point, known)
    support = shares.weighty(problem, point, size.unexplained)
    if support == point.support:
        return point, size
    point = refit.refitted(problem, point, support)
    return point, Sizes.of(problem, start, point, known)


def _steady(
    problem: Problem, seed: int
) -> tuple[Problem, Point, rest.Floor, np.ndarray]:
    """A recording without trials that may go anywhere, and with what changes nothing in
    it; the nominal model, the floor, and the windows ``(N,)`` of these trials."""
    problem, start, known = _begun(problem, seed)
    unstable = rest.unstable(problem, start.slopes, known)
    if unstable.any() and not unstable.all():
        problem = problem.without(unstable)
        start = descent.nothing(problem)
    return replace(problem, silent=fit.silent(problem, start)), start, known, unstable


def _begun(problem: Problem, seed: int) -> tuple[Problem, Point, rest.Floor]:
    """A recording whose commands began where its log tells them, or since the sample
    before where it leaves that open and the gap is not far beyond what that may make
    of the motion: in a large one it is lost among what else a model lacks. The nominal
    model, and the floor, which holds what late commands change."""
    exact = replace(problem, dated=True)
    start = descent.nothing(exact)
    latent = start.noise.latent.beside(problem, start.rest)
    known = rest.floor(problem, latent, seed=seed)
    large = rest.excess(start.rest, known, problem.seen) > BEYOND_LATE
    if large or not problem.any_open:
        return exact, start, known
    return problem, descent.nothing(problem, start), known


def _numbers(problem: Problem, windows: np.ndarray) -> tuple[int, ...]:
    """Numbers of the trials that windows ``(N,)`` are of."""
    return tuple(problem.numbers[n] for n in np.unique(problem.trial[windows]))
