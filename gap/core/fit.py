"""Bounded fits of one to three effects, started from the signatures."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np

from bns.gap.core.gauss_newton import ENOUGH, HOPELESS, Bar, refining
from bns.gap.core.problem import Problem
from bns.gap.core.support import Point, Term, evaluate, finite
from bns.gap.core.whitening import loss

FINISHES = 3  # rounds in which a rough fit is put right by the true simulation
# Fits that are worse than the best by so many `HOPELESS` and by this share of what it
# explains stay rough; the rough simulation may misjudge a strong effect by as much.
FAR, SHARE = 2.0, 0.2
SCAN = 0.7, 0.85, 1.15, 1.35, 1.6  # of a fitted departure, tried where curves wind


def refine(problem: Problem, start: Sequence[Term]) -> Point:
    """Fit the magnitudes (and extras) of a support from a start, see `refine_all`."""
    return refine_all(problem, [start])[0]


def refine_all(
    problem: Problem, starts: Sequence[Sequence[Term]], *, finish: bool = True
) -> list[Point]:
    """Fit the magnitudes (and extras) of several supports, side by side.

    Bounded Gauss-Newton on the simulation itself with secant updates of the slopes;
    a parameter without slope (or a whole number) is searched on a shrinking grid. What
    all fits want simulated next is simulated in one batch. A fit that is not on its way
    to within `HOPELESS` of the best is given up. The result is never worse than the
    start. Where the model has a rough simulation, fits are made on it; what it lacks
    against the true one at the fit is added to it, and the fit goes on from there.

    Args:
        problem: the recording.
        starts: terms to start from, of each support.
        finish: False = leave the fits as the rough simulation has them.
    """
    points = _side_by_side(problem, starts)
    if not finish:
        return points
    made = _trued(problem, points)
    if not hasattr(problem.model, "sketch"):
        return _scanned(problem, made) if getattr(problem.model, "winding", 0) else made
    again = list(range(len(made)))
    for _ in range(FINISHES):
        best = min((point.loss for point in made), default=np.inf)
        again = [
            number
            for number in again
            if made[number].loss < best + HOPELESS
            and abs(points[number].loss - made[number].loss) > ENOUGH
        ]
        lacks = [made[number].rest - points[number].rest for number in again]
        found = _side_by_side(problem, [points[n].terms for n in again], lacks)
        for number, point, true in zip(
            again, found, _trued(problem, found), strict=True
        ):
            points[number] = point
            if true.loss < made[number].loss:
                made[number] = true
    return made


def _trued(problem: Problem, points: Sequence[Point]) -> list[Point]:
    """Points with the rest that the true simulation leaves; far ones as they are."""
    made = list(points)
    best = min((point.loss for point in points), default=np.inf)
    explained = max(float(loss(problem.rest)) - best, 0.0)
    limit = best + FAR * HOPELESS + SHARE * explained
    near = [number for number, point in enumerate(points) if point.loss < limit]
    exact = evaluate(problem, [points[number].terms for number in near])
    for number, true in zip(near, exact, strict=True):
        made[number] = replace(true, slopes=points[number].slopes)
    return made


def _scanned(problem: Problem, points: Sequence[Point]) -> list[Point]:
    """Points moved to another magnitude where that is better; far ones as they are.

    Where signatures wind, the loss has many minima, and going downhill ends in one.
    """
    made, asked = list(points), []
    best = min((point.loss for point in points), default=np.inf)
    for number, point in enumerate(points):
        if point.loss < best + HOPELESS:
            asked += [(number, terms) for terms in _elsewhere(point.terms)]
    found = evaluate(problem, [terms for _, terms in asked])
    for (number, _), other in zip(asked, found, strict=True):
        if other.loss < made[number].loss:
            made[number] = replace(other, slopes=points[number].slopes)
    return made


def _elsewhere(terms: Sequence[Term]) -> Iterator[tuple[Term, ...]]:
    """A support with one of its magnitudes changed by a share of its departure."""
    for place, term in enumerate(terms):
        item = term.candidate
        for share in SCAN:
            value = item.nominal + share * (term.magnitude - item.nominal)
            moved = replace(term, magnitude=min(max(value, item.low), item.high))
            yield (*terms[:place], moved, *terms[place + 1 :])


def _side_by_side(
    problem: Problem,
    starts: Sequence[Sequence[Term]],
    lacks: Sequence[np.ndarray] | None = None,
) -> list[Point]:
    """Fits by the rough simulation, to whose rest `lacks` are added, one by start."""
    bar = Bar()
    tasks = [refining(tuple(start), bar) for start in starts]
    wanted = {number: next(task) for number, task in enumerate(tasks)}
    done: dict[int, Point] = {}
    while wanted:
        supports = [terms for ask in wanted.values() for terms in ask]
        points = evaluate(problem, supports, rough=True)
        asked, wanted = wanted, {}
        for number, ask in asked.items():
            given, points = points[: len(ask)], points[len(ask) :]
            if lacks is not None:
                given = [_shifted(point, lacks[number]) for point in given]
            try:
                wanted[number] = tasks[number].send(given)
            except StopIteration as finished:
                done[number] = finished.value
    return [done[number] for number in range(len(tasks))]


def _shifted(point: Point, lack: np.ndarray) -> Point:
    rest = point.rest + lack
    return replace(point, rest=rest, loss=finite(loss(rest)))
