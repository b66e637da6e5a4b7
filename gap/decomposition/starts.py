"""The explanations of a recording: starts from which a set of them is looked for."""

import itertools
from collections.abc import Iterable
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit, levels, refit, simpler
from bns.gap.decomposition.descent import NUMEROUS, descend, nothing, renewed, simplest
from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.linear import Support
from bns.gap.decomposition.fit import Point, linearised, placed
from bns.gap.decomposition.levels import Level
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.refit import newton
from bns.gap.decomposition.singles import Single, Singles, leading, wide

INSTEAD = 3  # explanations one of which another may replace
OTHERS = 3  # single explanations from which several are looked for again
FEW = 2  # explanations that need no other start if they leave little
ENOUGH = 1.2  # times what all explanations leave: little more
LITTLE = 0.02  # of what all explain: the rest of a strong one's law,
LEAST = 0.01  # and of two
NEARLY = 1.5  # the same where these, all together, only describe the recording
STRETCHED = 4.0  # deviations of slack that are no slack any more
ROUNDS = 2  # of levels
GLANCE = 30.0  # [s] of a long recording, in which explanations are looked for first
BRIEF = 18.0  # [s] the same of a robot of which numerous explanations are tried
LONG = 2.5  # times as much, from which it is long
WORTH = 1.0  # by how much the evidence has to rise for a start to be followed


def explained(tried: Singles) -> Point:
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
        best = renewed(problem, best)
    best = _instead(tried, simplest(problem, best))
    return _beyond_chance(problem, start, best, len(start.linear.free))


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
    return refit.better(problem, [best, simplest(problem, again)])


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
    points = _glimpsed(tried)
    if points and len(problem.terms) > NUMEROUS:
        return refit.better(problem, points + [best] * bool(best.support))
    if not any(enough(problem, point) for point in points):
        points += _simple(tried) + [best] * bool(best.support)
    if not any(enough(problem, point) for point in points):
        if not best.support:
            points.append(_followed(problem, tried.start, found))
        if problem.model.many:
            points.append(_from_all(problem, tried.start))
            return _from_others(tried, refit.better(problem, points))
    return refit.better(problem, points)


def _glimpsed(tried: Singles) -> list[Point]:
    """A point from what explains a part of a long recording, if it is long and anything
    does: the same search costs as much less."""
    problem, start = tried.problem, tried.start
    glance = BRIEF if len(problem.terms) > NUMEROUS else GLANCE
    whole = sum(trial.commands.duration for trial in problem.trials)
    numbers = problem.sample(glance)
    if whole < LONG * glance or len(numbers) == len(problem.trials):
        return []
    part = problem.some(numbers)
    found = explained(Singles(part, nothing(part)))
    if not found.support:
        return []
    return [descend(problem, found.values, found.support, start.noise, start)]


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

    Where many depart, it does for the strongest few: if a single one, or two, close
    next to all of the gap, since what is weak beside them needs no other start; and for
    more where all together, a hundred numbers, foretell motion that was not fitted no
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
        gap = linear.squares(()) - whole
        if strong - whole < LITTLE * gap or left - whole < LEAST * gap:
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
