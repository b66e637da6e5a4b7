"""Bounded fits of one to three effects, started from the signatures."""

from collections.abc import Generator, Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import lsq_linear

from bns.gap.problem import Problem
from bns.gap.records import Candidate
from bns.gap.signatures import integer
from bns.gap.whiten import loss, weights
from bns.worlds.effects.base import Effect

ROUNDS = 5  # of Gauss-Newton
ENOUGH = 0.05  # improvement of the loss below which a fit stops
AHEAD = 4.0  # times the last improvement that a fit may still gain
ZOOM, ZOOMS = 8, 3  # points and rounds where there is no slope
HOPELESS = 60.0  # a fit so much worse than the best is not worth its while
FLAT = 0.3  # slope over the chord's below which a parameter counts as without slope


@dataclass(frozen=True)
class Term:
    """A candidate with values: one of the effects of a fit."""

    candidate: Candidate
    branch: int
    magnitude: float
    extras: tuple[float, ...] = ()

    @classmethod
    def at(cls, candidate: Candidate, branch: int, magnitude: float) -> "Term":
        """With the extras of the branch."""
        values = {**candidate.fixed, **candidate.branches[branch]}
        extras = tuple(float(values.get(name, 0.0)) for name in candidate.extras)
        return cls(candidate, branch, float(magnitude), extras)

    def effect(self) -> Effect:
        """As an effect of the library."""
        extras = dict(zip(self.candidate.extras, self.extras, strict=True))
        return self.candidate.make(self.magnitude, self.branch, extras)

    @property
    def at_bound(self) -> bool:
        """Whether the magnitude sits on a bound that is not the nominal."""
        item, near = self.candidate, 1e-6 * (self.candidate.high - self.candidate.low)
        ends = [end for end in (item.low, item.high) if end != item.nominal]
        return any(abs(self.magnitude - end) <= near for end in ends)


@dataclass(frozen=True, eq=False)
class Point:
    """A fit: terms, the whitened rest and its slopes.

    Attributes:
        terms: the effects.
        rest: whitened recorded minus predicted, ``(N,)``.
        loss: of the rest.
        slopes: change of the prediction by each magnitude, then each extra of the
            first term and so on, ``(p, N)``; empty until fitted.
    """

    terms: tuple[Term, ...]
    rest: np.ndarray
    loss: float
    slopes: np.ndarray

    @property
    def names(self) -> tuple[str, ...]:
        """Names of the candidates."""
        return tuple(term.candidate.name for term in self.terms)


def evaluate(
    problem: Problem, supports: Sequence[Sequence[Term]], *, rough: bool = False
) -> list[Point]:
    """The loss of supports as they are, in one batch of simulations."""
    if not supports:
        return []
    effects = [[term.effect() for term in terms] for terms in supports]
    rests = problem.rest - problem.signatures(effects, rough=rough)
    return [
        Point(tuple(terms), rest, _finite(loss(rest)), np.zeros((0, len(rest))))
        for terms, rest in zip(supports, rests, strict=True)
    ]


def _finite(value: float) -> float:
    return float(value) if np.isfinite(value) else np.inf


Asking = Generator[list[tuple[Term, ...]], list[Point], Point]


class Bar:
    """The best loss among fits that are made side by side."""

    def __init__(self, loss: float = np.inf):
        self.loss = loss

    @property
    def target(self) -> float:
        """A loss that a fit has to be on its way to."""
        return self.loss + HOPELESS


def refine(problem: Problem, start: Sequence[Term]) -> Point:
    """Fit the magnitudes (and extras) of a support from a start, see `refine_all`."""
    return refine_all(problem, [start])[0]


def refine_all(problem: Problem, starts: Sequence[Sequence[Term]]) -> list[Point]:
    """Fit the magnitudes (and extras) of several supports, side by side.

    Bounded Gauss-Newton on the simulation itself with secant updates of the slopes;
    a parameter without slope (or a whole number) is searched on a shrinking grid. What
    all fits want simulated next is simulated in one batch. A fit that is not on its way
    to within `HOPELESS` of the best is given up. The result is never worse than the
    start. Where the model has a rough simulation, fits are made on it and finished on
    the true one where the two differ.

    Args:
        problem: the recording.
        starts: terms to start from, of each support.
    """
    points = _side_by_side(problem, starts, rough=True)
    exact = evaluate(problem, [point.terms for point in points])
    best = min((point.loss for point in exact), default=np.inf)
    again = [
        number
        for number, (point, true) in enumerate(zip(points, exact, strict=True))
        if abs(point.loss - true.loss) > ENOUGH and true.loss < best + HOPELESS
    ]
    made = [replace(t, slopes=p.slopes) for p, t in zip(points, exact, strict=True)]
    better = _side_by_side(problem, [points[n].terms for n in again], rough=False)
    for number, point in zip(again, better, strict=True):
        made[number] = point
    return made


def _side_by_side(
    problem: Problem, starts: Sequence[Sequence[Term]], *, rough: bool
) -> list[Point]:
    bar = Bar()
    tasks = [_refining(tuple(start), bar) for start in starts]
    wanted = {number: next(task) for number, task in enumerate(tasks)}
    done: dict[int, Point] = {}
    while wanted:
        supports = [terms for ask in wanted.values() for terms in ask]
        points = evaluate(problem, supports, rough=rough)
        asked, wanted = wanted, {}
        for number, ask in asked.items():
            given, points = points[: len(ask)], points[len(ask) :]
            try:
                wanted[number] = tasks[number].send(given)
            except StopIteration as finished:
                done[number] = finished.value
    return [done[number] for number in range(len(tasks))]


def _refining(start: tuple[Term, ...], bar: Bar) -> Asking:
    (point,) = yield [start]
    bar.loss = min(bar.loss, point.loss)
    point = yield from _descending(point, bar)
    bar.loss = min(bar.loss, point.loss)
    for place, term in enumerate(point.terms):
        hopeless = point.loss > 4 * bar.target + 1e3
        stepped = integer(term.candidate) or term.candidate.stepped
        near = point.loss < bar.target
        if (stepped and near) or (not hopeless and _is_flat(point, place)):
            point = yield from _zooming(point, place)
            bar.loss = min(bar.loss, point.loss)
    return point


def _values(terms: Sequence[Term]) -> np.ndarray:
    return np.array([v for term in terms for v in (term.magnitude, *term.extras)])


def _with(terms: Sequence[Term], values: np.ndarray) -> tuple[Term, ...]:
    made, at = [], 0
    for term in terms:
        end = at + 1 + len(term.extras)
        magnitude = float(values[at])
        extras = tuple(float(v) for v in values[at + 1 : end])
        made.append(replace(term, magnitude=magnitude, extras=extras))
        at = end
    return tuple(made)


def _box(terms: Sequence[Term]) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Lower and upper bounds and steps of numerical slopes."""
    rows = []
    for term in terms:
        item = term.candidate
        reach = abs(term.magnitude - item.nominal)
        step = max(0.03 * reach, 1e-4 * (item.high - item.low))
        rows.append((item.low, item.high, step))
        rows += [(value - 1.0, value + 1.0, 0.05) for value in term.extras]
    low, high, step = np.array(rows, dtype=float).T
    return low, high, step


def _sloping(point: Point) -> Asking:
    """The point with its slopes: change of the prediction by each parameter."""
    values = _values(point.terms)
    _, high, step = _box(point.terms)
    step = np.where(values + step > high, -step, step)
    moved = yield [_with(point.terms, values + row) for row in np.diag(step)]
    rests = np.array([found.rest for found in moved])
    return replace(point, slopes=np.nan_to_num((point.rest - rests) / step[:, None]))


def _descending(point: Point, bar: Bar) -> Asking:
    if not np.isfinite(point.loss) or not point.terms:
        return point
    point = yield from _sloping(point)
    for _ in range(ROUNDS):
        values, (low, high, _) = _values(point.terms), _box(point.terms)
        weight = weights(point.rest)
        size = np.linalg.norm(point.slopes * weight, axis=1) + 1e-12
        if size.max() < 1e-9:
            break
        step = lsq_linear(
            (point.slopes * weight / size[:, None]).T,
            point.rest * weight,
            bounds=((low - values) * size - 1e-9, (high - values) * size + 1e-9),
        ).x
        step = np.clip(values + step / size, low, high) - values
        tried = yield [_with(point.terms, values + k * step) for k in (1.0, 0.3)]
        best = min(tried, key=lambda found: found.loss)
        if best.loss >= point.loss - 1e-9:
            break
        moved = _values(best.terms) - values
        missing = (point.rest - best.rest) - moved @ point.slopes
        update = point.slopes + np.outer(moved, missing) / max(moved @ moved, 1e-300)
        gain = point.loss - best.loss
        point = replace(best, slopes=update)
        bar.loss = min(bar.loss, point.loss)
        if gain < ENOUGH or point.loss - AHEAD * gain > bar.target:
            break
    return point


def _position(terms: Sequence[Term], place: int) -> int:
    return place + sum(len(term.extras) for term in terms[:place])


def _is_flat(point: Point, place: int) -> bool:
    """Whether the loss falls far less by the slope than over the whole effect."""
    if not len(point.slopes):
        return False
    term = point.terms[place]
    slope = np.linalg.norm(point.slopes[_position(point.terms, place)])
    return slope * abs(term.magnitude - term.candidate.nominal) < FLAT * np.sqrt(
        max(len(point.rest), 1)
    )


def _zooming(point: Point, place: int) -> Asking:
    term = point.terms[place]
    item = term.candidate
    marks = np.unique([*item.grid, item.nominal, item.low, item.high])
    below = marks[marks < term.magnitude].max(initial=item.low)
    above = marks[marks > term.magnitude].min(initial=item.high)
    for _ in range(1 if integer(item) else ZOOMS):
        tried = (
            np.arange(max(item.low, term.magnitude - 3), term.magnitude + 4)
            if integer(item)
            else np.linspace(below, above, ZOOM + 2)
        )
        tried = tried[(tried >= item.low) & (tried <= item.high)]
        supports = [
            (
                *point.terms[:place],
                replace(point.terms[place], magnitude=float(value)),
                *point.terms[place + 1 :],
            )
            for value in tried
        ]
        found = yield supports
        losses = np.array([other.loss for other in found])
        best = int(losses.argmin())
        if losses[best] < point.loss:
            point = replace(found[best], slopes=point.slopes)
        below, above = tried[max(best - 1, 0)], tried[min(best + 1, len(tried) - 1)]
    return point
