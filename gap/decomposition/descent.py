"""From a start to a set of explanations that stays when the problem is made linear
around it."""

import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit, levels, refit, search, simpler
from bns.gap.decomposition.fit import Noise, Point, linearised, placed
from bns.gap.decomposition.levels import Level
from bns.gap.decomposition.linear import Support
from bns.gap.decomposition.noise import Memory
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton
from bns.gap.decomposition.shares import HeldOut
from bns.gap.decomposition.singles import Single, Singles, leading, wide

TURNS = 4  # of fitting and searching
INSTEAD = 3  # explanations one of which another may replace
OTHERS = 3  # single explanations from which several are looked for again
NUMEROUS = 60  # explanations of a robot of which one start takes a minute
FEW = 2  # explanations that need no other start if they leave little
ENOUGH = 1.2  # times what all explanations leave: little more
LITTLE = 0.02  # of what all explain: the rest of a strong one's law
NEARLY = 1.5  # the same where these, all together, only describe the recording
STRETCHED = 4.0  # deviations of slack that are no slack any more
ROUNDS = 2  # of levels, and of what walkers scatter
MARGIN = 1.02  # of the held-out error that an autoregression may cost
PATIENCE = 2  # points in a row that are no better than those before
WORTH = 1.0  # by how much the evidence has to rise for a start to be followed


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


def decompose(tried: Singles) -> Point:
    """The explanations of a recording.

    Started from a tangent at the nominal model, from the best single explanation (a
    strong one looks like several through a tangent), from all at once where several
    are strong, and from levels of what has no slope at the nominal. Nothing, if they
    have no more evidence than the best of so many has by chance.

    Args:
        tried: the recording, the nominal model, and single explanations fitted.
    """
    problem, start = tried.problem, tried.start
    several = not problem.model.singly
    found = search.best(start.linear)[1] if several else frozenset()
    best = start if several else _alone(tried)
    if len(found) == 1:
        best = _followed(problem, start, found)
    broad = any(wide(problem.terms, name) for name in found)
    if several and (broad or len(found | best.support) > 1):
        best = _several(tried, found, best)
    for _ in range(ROUNDS):
        level = levels.best(problem, best)
        if level is None or level.cost > best.cost - WORTH:
            break
        others = [descend(problem, level.values, level.support, best.noise, best)]
        if several and level.support > {level.name}:
            others.append(_by_itself(problem, level, best))
        chosen = refit.better(problem, [best, *others])
        if chosen is best:
            break
        best = chosen
    if problem.model.many:
        best = _renewed(problem, best)
    best = _instead(tried, _simplest(problem, best))
    return _beyond_chance(problem, start, best, len(start.linear.free))


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
        point = _simplest(problem, point)
        if point.support == support:
            break
    return problem, point


def _simplest(problem: Problem, point: Point) -> Point:
    """A point made simpler. Where many may depart and another explanation took the
    place of one, what stood beside the wrong one may go: the set is searched again."""
    made = simpler.simplest(problem, point)
    if not problem.model.many or made.support == point.support:
        return made
    again = descend(problem, made.values, made.support, made.noise, made)
    return refit.better(problem, [made, again])


def _instead(tried: Singles, best: Point) -> Point:
    """A point of few explanations with another one in the place of one that changes
    alike, if that is better: begun as it is by itself, for of what is strong and not
    linear (friction in whose place a damping was found) no slope beside it tells."""
    problem, support = tried.problem, best.support
    if problem.model.singly or not 1 < len(support) <= INSTEAD:
        return best
    others, linear = [], best.linear
    pairs = [
        (one, gone)
        for gone in sorted(support)
        for one in simpler.rivals(linear, gone, set(linear.free) - support)
    ]
    fits = {one.name: one for one in tried.among({name for name, _ in pairs})}
    for name, gone in pairs:
        if name not in fits:
            continue
        one = fits[name]
        values = best.values.copy()
        back, put = (list(problem.terms[name]) for name in (gone, one.name))
        values[back] = problem.nominal[back]
        values[put] = one.values[put]
        begun = replace(best, values=values)
        names = (support - {gone}) | {one.name}
        others.append(refit.fitted_at(problem, begun, names, near=True))
    found = refit.better(problem, [best, *others])
    if found is best:
        return best
    again = descend(problem, found.values, found.support, found.noise)
    return refit.better(problem, [best, _simplest(problem, again)])


def _renewed(problem: Problem, best: Point) -> Point:
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


def _by_itself(problem: Problem, level: Level, best: Point) -> Point:
    """A point from the explanation of a level alone: what was found before it, `best`,
    may have stood in its place."""
    values = problem.nominal.copy()
    rows = list(problem.terms[level.name])
    values[rows] = level.values[rows]
    return descend(problem, values, {level.name}, best.noise, best)


def _several(tried: Singles, found: Support, best: Point) -> Point:
    """The best point where a tangent finds several explanations, or one of many
    numbers: from a single one, and if that is not enough from those that it found, and
    from all where many depart."""
    problem = tried.problem
    points = _simple(tried) + [best] * bool(best.support)
    if not any(enough(problem, point) for point in points):
        if not best.support:
            points.append(_followed(problem, tried.start, found))
        if problem.model.many:
            points.append(_from_all(problem, tried.start))
            return _from_others(tried, refit.better(problem, points))
    return refit.better(problem, points)


def _from_others(tried: Singles, best: Point) -> Point:
    """A point of several explanations, or a better one from single explanations that
    leave more than the best: beside a strong one that is not the cause, several weak
    ones describe what it does otherwise, and no exchange of one for another leads away
    from all of them."""
    problem, start = tried.problem, tried.start
    if len(best.support) <= FEW or len(start.linear.free) > NUMEROUS:
        return best
    first = leading(problem.terms, tried.fitted)
    for one in [one for one in tried.fitted if one not in first][:OTHERS]:
        here = descend(problem, one.values, {one.name}, start.noise, start)
        best = refit.better(problem, [best, here])
        if len(best.support) <= FEW:
            break
    return best


def enough(problem: Problem, point: Point, few: int = FEW) -> bool:
    """Whether few explanations leave little more than all together do.

    Where many depart, it does for the strongest few: if a single one closes next to all
    of the gap, since what is weak beside it needs no other start; and for somewhat more
    where all together, a hundred numbers, foretell motion that was not fitted no
    better.

    Args:
        problem: the recording.
        point: a fitted set.
        few: how many.
    """
    linear, support, many = point.linear, sorted(point.support), problem.model.many
    if len(support) > few and not many:
        return False
    sets = itertools.combinations(support, min(few, len(support)))
    best = min(sets, key=linear.squares)
    left, whole = linear.squares(best), linear.squares(linear.free)
    if many and support:
        strong = min(linear.squares({name}) for name in support)
        if strong - whole < LITTLE * (linear.squares(()) - whole):
            return True
    if left < ENOUGH * whole or not many:
        return left < ENOUGH * whole
    if left >= NEARLY * whole:
        return False
    some, every = (linear.held_out(names).sum() for names in (best, linear.free))
    return bool(some < every)


def _followed(problem: Problem, start: Point, support: Support) -> Point:
    """A point from a set found by the tangent at the nominal model."""
    values = placed(problem, start.linear, support, start.values)
    return descend(problem, values, support, start.noise, start)


def _simple(tried: Singles) -> list[Point]:
    """Points from the best single explanation, and from it with a level on top; if it
    has many numbers, which imitate much, from the best one of few, too.

    Where many depart, what the tangent finds does if it is enough by itself: only then
    it is followed before the others are tried."""
    problem, start = tried.problem, tried.start
    made: dict[Single, Point] = {}
    for one in leading(problem.terms, tried.by_tangent) if problem.model.many else []:
        here = refit.fitted_at(problem, replace(start, values=one.values), {one.name})
        if enough(problem, here, 1):
            made |= _from(tried, [one])
            if enough(problem, made[one], 1):
                return list(made.values())
    first = leading(problem.terms, tried.fitted)
    made |= _from(tried, [one for one in first if one not in made])
    points = [made[one] for one in first]
    if not enough(problem, points[0]):
        points += _with_level(problem, first[0], start)
    return points


def _from(tried: Singles, singles: Iterable[Single]) -> dict[Single, Point]:
    """A point from each of some single explanations."""
    problem, start = tried.problem, tried.start
    return {
        one: descend(problem, one.values, {one.name}, start.noise, start)
        for one in singles
    }


def _alone(tried: Singles) -> Point:
    """From the single explanation that leaves least, or nothing."""
    problem, start = tried.problem, tried.start
    if not tried.fitted:
        return start
    best = tried.fitted[0]
    found = descend(problem, best.values, {best.name}, start.noise)
    return _beyond_chance(problem, start, found, len(tried.fitted))


def _beyond_chance(problem: Problem, start: Point, found: Point, count: int) -> Point:
    """A point; the nominal model, if it is no better than the best of `count`
    explanations is by chance, and if that is not because slack stands for them."""
    nominal, here = refit.costs(problem, [start, found])
    if here + np.log(max(count, 1)) < nominal:
        return found
    inside = found.support <= _stretched(problem, start)
    return found if found.support and inside else start


def _stretched(problem: Problem, start: Point) -> Support:
    """Explanations that the nominal model takes farther than it may be off: their slack
    is a deviation, and so many are none."""
    linear, found = start.linear, set()
    for value, column in zip(linear.solve(frozenset()), linear.columns, strict=True):
        row = problem.rows[column]
        slack = row.slack or np.inf
        if not row.nuisance and abs(value) * row.sd > STRETCHED * slack:
            found.add(row.term)
    return frozenset(found)


def _with_level(problem: Problem, best: Single, start: Point) -> list[Point]:
    """A point from a single explanation and a level on top of it, if there is one:
    through a tangent that lacks the level, the rest of it looks like several others."""
    single = refit.fitted_at(problem, replace(start, values=best.values), {best.name})
    level = levels.best(problem, single)
    if level is None or level.cost > single.cost - WORTH:
        return []
    return [descend(problem, level.values, level.support, single.noise, single)]


def _from_all(problem: Problem, start: Point) -> Point:
    """From everything at once: a step of the fit, linear again there, and so on; the
    derivatives of all rows are what costs time."""
    everything, point = set(start.linear.free) | fit.nuisances(problem), start
    for _ in range(refit.STEPS):
        at, slopes = point.values, point.slopes
        values, rest = newton(
            problem, at, everything, point.noise, turns=1, slopes=slopes
        )
        linear, known, slopes = linearised(problem, values, rest, point.noise)
        point = Point(values, frozenset(), rest, linear, slopes, known, values)
        if np.abs((values - at) / problem.sd).max() <= fit.FAR:
            break
    found = search.best(point.linear)[1]
    values = placed(problem, point.linear, found, point.values)
    return descend(problem, values, found, point.noise, point)
