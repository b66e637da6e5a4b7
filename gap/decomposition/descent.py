"""From a start to a set of explanations that stays when the problem is made linear
around it."""

from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit, levels, refit, simpler
from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.noise import Memory
from bns.gap.decomposition.fit import Noise, Point, linearised, placed
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton
from bns.gap.decomposition.shares import HeldOut

TURNS = 4  # of fitting and searching
NUMEROUS = 60  # explanations of a robot of which one start takes a minute
ROUNDS = 2  # of what walkers scatter, and of derivatives taken anew
MARGIN = 1.02  # of the held-out error that an autoregression may cost
PATIENCE = 2  # points in a row that are no better than those before


def nothing(problem: Problem, near: Point | None = None) -> Point:
    """The nominal model, its nuisances fitted.

    Args:
        problem: the recording.
        near: the same beside another noise, whose values and derivatives are taken.
    """
    if near is None:
        values = problem.nominal.copy()
        rest, made = problem.residual(values)
        first, slopes = fit.first_noise(problem, rest, made), None
        values, rest = newton(problem, values, fit.nuisances(problem), first)
    else:
        values, rest, slopes = near.values, near.rest, near.slopes
        first = replace(near.noise, memory=Memory.none(problem.trial, rest.shape[1]))
    linear, known, slopes = linearised(problem, values, rest, first, slopes)
    plain = Point(values, frozenset(), rest, linear, slopes, known, values)
    if not problem.model.memory:
        return plain
    linear, known, slopes = linearised(
        problem, values, rest, first, slopes, problem.model.memory
    )
    remembering = Point(values, frozenset(), rest, linear, slopes, known, values)
    worse = _held_out(problem, remembering) > MARGIN * _held_out(problem, plain)
    return plain if worse else remembering


def _held_out(problem: Problem, point: Point) -> float:
    """Plain held-out error of the set of highest evidence: whether an autoregression
    helps is for this to say. It does where errors are random walks, not where they are
    the model's."""
    _, support = search.best(point.linear)
    return float(HeldOut.of(problem, point).error(support).sum())


def descend(
    problem: Problem,
    values: np.ndarray,
    support: Iterable[str],
    known: Noise,
    near: Point | None = None,
) -> Point:
    """Fit a set, make the problem linear there, search again, until the set stays.

    Args:
        problem: the recording.
        values: of all rows to start from, ``(R,)``.
        support: explanations to start from.
        known: noise to start from.
        near: a point whose derivatives may serve where many may depart, see
            `fit.lasting`.

    Returns:
        the point of highest evidence on the way, after `TURNS` searches at most: around
        a strong effect a linear model may lead away from it.
    """
    singly = problem.model.singly
    support, near = frozenset(support), near if problem.model.many else None
    before = [near] if near else []
    passed: list[Point] = []
    values = refit.nearer(problem, values, support, known)
    between = refit.LOOKS if singly else refit.STEPS
    for _ in range(TURNS):
        fitted = set(support) | fit.nuisances(problem)
        values, rest = newton(problem, values, fitted, known, turns=between)
        values, rest = levels.zoomed(problem, values, rest, support, known)
        kept = fit.lasting(problem, near, support, values) if near else None
        linear, known, slopes = linearised(problem, values, rest, known, kept)
        at = values if kept is None or near is None else near.at
        inside = support & set(linear.terms)  # without what came back to nominal
        near = Point(values, inside, rest, linear, slopes, known, at)
        found = search.best(linear, start=support, backward=not singly)[1]
        if found == support:
            break
        passed.append(near)
        tried = [*before, *passed]
        if len(tried) > PATIENCE and refit.better(problem, tried) in tried[:-PATIENCE]:
            return refit.better(problem, passed)
        support = found
        values = refit.nearer(
            problem, placed(problem, linear, support, values), support, known
        )
    # the last fit was under the noise of the point before
    fitted = set(support) | fit.nuisances(problem)
    most = 2 if singly else refit.STEPS
    values, rest = newton(problem, values, fitted, known, turns=most)
    last = Point(values, support, rest, linear, slopes, known, at)
    return refit.better(problem, [last, *passed])


def beside(problem: Problem, point: Point) -> tuple[Problem, Point]:
    """The explanations once more, with what a model does otherwise beside them: a robot
    whose commands come late walks otherwise, and scatters otherwise, than the nominal
    one; starts that were fitted to the nominal motion are not those of theirs. As they
    are, where nothing is otherwise.

    Args:
        problem: the recording.
        point: what was found beside the nominal model.
    """
    rounds = 1 if len(problem.terms) > NUMEROUS else ROUNDS
    for _ in range(rounds if point.support else 0):
        trials, support = problem.trials, point.support
        model, begun = problem.model.beside(trials, problem.known(point.values))
        same = all(one is other for one, other in zip(begun, trials, strict=True))
        if model is problem.model and same:
            break
        other = np.array([row.nuisance for row in problem.rows])
        other &= model is not problem.model
        values = np.where(other, problem.nominal, point.values)
        problem = replace(problem, model=model, trials=tuple(begun))
        point = descend(problem, values, support, point.noise)
        point = simplest(problem, point)
        if point.support == support:
            break
    return problem, point


def simplest(problem: Problem, point: Point) -> Point:
    """A point made simpler. Where many may depart and another explanation took the
    place of one, what stood beside the wrong one may go: the set is searched again."""
    made = simpler.simplest(problem, point)
    if not problem.model.many or made.support == point.support:
        return made
    again = descend(problem, made.values, made.support, made.noise, made)
    return refit.better(problem, [made, again])


def renewed(problem: Problem, best: Point) -> Point:
    """A point with all derivatives taken near it; where these lead to another set, the
    better of both."""
    for _ in range(ROUNDS):
        if np.abs((best.values - best.at) / problem.sd).max() <= fit.FAR:
            return best
        linear, known, slopes = linearised(problem, best.values, best.rest, best.noise)
        inside, values = best.support & set(linear.terms), best.values
        here = Point(values, inside, best.rest, linear, slopes, known, values)
        found = search.best(linear, start=inside)[1]
        if found == inside:
            return here
        values = placed(problem, linear, found, values)
        best = refit.better(
            problem, [here, descend(problem, values, found, known, here)]
        )
        if best is here:
            return here
    return best
