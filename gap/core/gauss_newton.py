"""How one fit goes downhill, as a generator that asks for what it wants simulated."""

from collections.abc import Generator, Sequence
from dataclasses import replace

import numpy as np
from scipy.optimize import lsq_linear

from bns.gap.core.signatures import integer
from bns.gap.core.support import Point, Term
from bns.gap.core.whitening import weights

ROUNDS = 8  # of Gauss-Newton
ENOUGH = 0.05  # improvement of the loss below which a fit stops
AHEAD = 4.0  # times the last improvement that a fit may still gain
ZOOM, ZOOMS = 8, 3  # points and rounds where there is no slope
HOPELESS = 60.0  # a fit so much worse than the best is not worth its while
FLAT = 0.3  # slope over the chord's below which a parameter counts as without slope

Asking = Generator[list[tuple[Term, ...]], list[Point], Point]


class Bar:
    """The best loss among fits that are made side by side."""

    def __init__(self, loss: float = np.inf):
        self.loss = loss

    @property
    def target(self) -> float:
        """A loss that a fit has to be on its way to."""
        return self.loss + HOPELESS


def refining(start: tuple[Term, ...], bar: Bar) -> Asking:
    """A fit from a start: yields supports to evaluate, is sent their points."""
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
    point, fresh = (yield from _sloping(point)), True
    for _ in range(ROUNDS):
        step = _step(point)
        if step is None:
            break
        values = _values(point.terms)
        tried = yield [_with(point.terms, values + k * step) for k in (1.0, 0.3)]
        best = min(tried, key=lambda found: found.loss)
        gain = point.loss - best.loss
        if gain > 1e-9:
            moved = _values(best.terms) - values
            missing = (point.rest - best.rest) - moved @ point.slopes
            update = np.outer(moved, missing) / max(moved @ moved, 1e-300)
            point = replace(best, slopes=point.slopes + update)
            bar.loss = min(bar.loss, point.loss)
        if gain >= ENOUGH and point.loss - AHEAD * gain > bar.target:
            break
        if gain < ENOUGH and (fresh or point.loss > bar.target):
            break
        fresh = gain < ENOUGH
        if fresh:
            point = yield from _sloping(point)
    return point


def _step(point: Point) -> np.ndarray | None:
    """Of the parameters by Gauss and Newton inside their box; None without slope."""
    values, (low, high, _) = _values(point.terms), _box(point.terms)
    weight = weights(point.rest)
    size = np.linalg.norm(point.slopes * weight, axis=1) + 1e-12
    if size.max() < 1e-9:
        return None
    step = lsq_linear(
        (point.slopes * weight / size[:, None]).T,
        point.rest * weight,
        bounds=((low - values) * size - 1e-9, (high - values) * size + 1e-9),
    ).x
    return np.clip(values + step / size, low, high) - values


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
