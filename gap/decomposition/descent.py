"""From a start to a set of explanations that stays when the problem is made linear
around it; and which of several is the best."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit, levels, noise, search
from bns.gap.decomposition.fit import Noise, Point, linearised, newton, placed
from bns.gap.decomposition.levels import Level
from bns.gap.decomposition.linear import Linear, Support
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.shares import HeldOut
from bns.gap.decomposition.singles import Single, Singles

TURNS = 4  # of fitting and searching
STEPS = 5  # of a fit; a walker, whose contacts make steps dear, takes fewer
FEW = 2  # explanations that need no other start if they leave little
ENOUGH = 1.2  # times what all explanations leave: little more
ROUNDS = 2  # of levels
MARGIN = 1.02  # of the held-out error that an autoregression may cost
WEAK = 0.05  # of what a set explains: so little may be left to the others
TRIED = 3  # of these, the weakest first
SWAPPED = 30.0  # nats that another set may be worse by the linear model, to be fitted
SLIGHT = 0.25  # of a plausible departure: next to none
REWEIGHED = 2  # times that residuals are weighed by what is left of them
ALIKE = 0.4  # cosine of what two explanations change, from which one may undo the other
WORTH = 1.0  # by how much the evidence has to rise for a start to be followed


def nothing(problem: Problem) -> Point:
    """The nominal model, its nuisances fitted."""
    values = problem.nominal.copy()
    rest, made = problem.residual(values)
    first = fit.first_noise(problem, rest, made)
    values, rest = newton(problem, values, fit.nuisances(problem), first)
    linear, known, slopes = linearised(problem, values, rest, first)
    plain = Point(values, frozenset(), rest, linear, slopes, known)
    if not problem.model.memory:
        return plain
    linear, known, slopes = linearised(
        problem, values, rest, first, slopes, problem.model.memory
    )
    remembering = Point(values, frozenset(), rest, linear, slopes, known)
    worse = _held_out(problem, remembering) > MARGIN * _held_out(problem, plain)
    return plain if worse else remembering


def _held_out(problem: Problem, point: Point) -> float:
    """Plain held-out error of the set of highest evidence: whether an autoregression
    helps is for this to say. It does where errors are random walks, not where they are
    the model's."""
    _, support = search.best(point.linear)
    return float(HeldOut.of(problem, point).error(support).sum())


def descend(
    problem: Problem, values: np.ndarray, support: Iterable[str], known: Noise
) -> Point:
    """Fit a set, make the problem linear there, search again, until the set stays.

    Args:
        problem: the recording.
        values: of all rows to start from, ``(R,)``.
        support: explanations to start from.
        known: noise to start from.

    Returns:
        the point of highest evidence on the way, after `TURNS` searches at most: around
        a strong effect a linear model may lead away from it.
    """
    support, at = frozenset(support), None
    slopes: Mapping[int, np.ndarray] = {}
    passed: list[Point] = []
    for _ in range(TURNS):
        most = 3 if problem.model.singly else STEPS
        values, rest = newton(
            problem, values, _fitted(problem, support), known, turns=most
        )
        values, rest = levels.zoomed(problem, values, rest, support, known)
        near = at is not None and np.abs((values - at) / problem.sd).max() <= fit.FAR
        at = at if near else values.copy()
        kept = slopes if near else None
        linear, known, slopes = linearised(problem, values, rest, known, kept)
        found = search.best(linear, start=support, backward=not problem.model.singly)[1]
        if found == support:
            break
        inside = support & set(linear.terms)  # without what came back to nominal
        passed.append(Point(values, inside, rest, linear, slopes, known))
        support = found
        values = placed(problem, linear, support, values)
    # the last fit was under the noise of the point before
    most = 2 if problem.model.singly else STEPS
    values, rest = newton(problem, values, _fitted(problem, support), known, turns=most)
    last = Point(values, support, rest, linear, slopes, known)
    return better(problem, [last, *passed])


def _fitted(problem: Problem, support: Iterable[str]) -> set[str]:
    return set(support) | fit.nuisances(problem)


def better(problem: Problem, points: Sequence[Point]) -> Point:
    """The point of highest evidence."""
    if len(points) == 1:
        return points[0]
    return points[int(np.argmin(costs(problem, points)))]


def costs(problem: Problem, points: Sequence[Point]) -> list[float]:
    """Costs of points, each under its own noise with what that noise costs; as many
    residuals count as one for all."""
    lam = min(point.noise.lam for point in points)
    found = []
    for point in points:
        known = replace(point.noise, lam=lam)
        cost = relinearised(problem, point, known).cost(point.support)
        size = (np.log(known.sd[problem.seen]).sum() + known.starts.size) / lam
        found.append(float(cost + size))
    return found


def relinearised(problem: Problem, point: Point, known: Noise) -> Linear:
    """A point's linear model under another noise.

    Residuals weigh by what the set leaves with its slack and all nuisances in place: by
    what they were before, a gap that scatter may explain would weigh little.

    Args:
        problem: the recording.
        point: a fitted set.
        known: the other noise.
    """
    whole = known.innovations(
        fit.target(problem, point.values, point.rest, point.slopes)
    )
    design = {k: known.innovations(slope) for k, slope in point.slopes.items()}
    units = fit.units(problem, point.values)
    weight = known.weights(point.rest, problem.seen)
    for _ in range(REWEIGHED):
        made = Linear.of(problem, design, units, whole, weight).correlated(known.lam)
        left = made.rest(made.solve(point.support))
        weight = noise.weights(left, known.sd, problem.seen)
    return Linear.of(problem, design, units, whole, weight).correlated(known.lam)


def decompose(tried: Singles) -> Point:
    """The explanations of a recording.

    Started from a tangent at the nominal model, from the best single explanation (a
    strong one looks like several through a tangent), from all at once where several
    are strong, and from levels of what has no slope at the nominal.

    Args:
        tried: the recording, the nominal model, and single explanations fitted.
    """
    problem, start = tried.problem, tried.start
    several = not problem.model.singly
    found = search.best(start.linear)[1] if several else frozenset()
    best = start if several else _alone(tried)
    if len(found) == 1:
        best = _followed(problem, start, found)
    if several and len(found | best.support) > 1:
        best = _several(tried, found, best)
    for _ in range(ROUNDS):
        level = levels.best(problem, best)
        if level is None or level.cost > best.cost - WORTH:
            break
        others = [descend(problem, level.values, level.support, best.noise)]
        if several and level.support > {level.name}:
            others.append(_by_itself(problem, level, best.noise))
        chosen = better(problem, [best, *others])
        if chosen is best:
            break
        best = chosen
    best = narrowed(problem, best)
    return swapped(problem, best) if problem.model.many else pruned(problem, best)


def _by_itself(problem: Problem, level: Level, known: Noise) -> Point:
    """A point from the explanation of a level alone: what was found before it may have
    stood in its place."""
    values = problem.nominal.copy()
    rows = list(problem.terms[level.name])
    values[rows] = level.values[rows]
    return descend(problem, values, {level.name}, known)


def swapped(problem: Problem, point: Point) -> Point:
    """A point with another explanation in the place of one, where that is better once
    it is fitted: a delay for a lag.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    linear, support = point.linear, point.support
    outside = set(linear.free) - support
    swaps = [(support - {one}) | {other} for one in support for other in outside]
    near = sorted((linear.cost(swap), sorted(swap)) for swap in swaps)[:TRIED]
    worst = linear.cost(support) + SWAPPED
    others = [
        refitted(problem, point, frozenset(swap), near=True)
        for cost, swap in near
        if cost < worst
    ]
    best = better(problem, [point, *others])
    return best if best is point else fitted_at(problem, best, best.support)


def narrowed(problem: Problem, point: Point) -> Point:
    """A point with what an explanation covers in its place where that is as good: a
    shifted centre of mass for a load of next to no mass.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    for name in sorted(point.support & set(point.linear.covers)):
        first = problem.terms[name][0]
        covered = point.linear.covers[name] & set(problem.terms)
        off = point.values[first] - problem.nominal[first]
        if covered and abs(off) < SLIGHT * problem.sd[first]:
            support = (point.support - {name}) | covered
            other = refitted(problem, point, support)
            least, here = costs(problem, [other, point])
            point = other if least <= here else point
    return point


def pruned(problem: Problem, point: Point) -> Point:
    """A point without what the others explain as well once they are fitted again: what
    is strong and not linear leaves that to small ones beside it.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    point = parted(problem, joined(problem, point))
    while len(point.support) > 1:
        linear, support = point.linear, point.support
        whole = max(linear.squares(()) - linear.squares(support), 1e-9)
        last = {
            name: (linear.squares(support - {name}) - linear.squares(support)) / whole
            for name in support
        }
        weak = sorted((n for n in last if last[n] < WEAK), key=lambda n: (last[n], n))
        several = not problem.model.singly and 1 < len(weak) < len(support)
        together = [set(weak)] if several else []
        for names in (*together, *({name} for name in weak[:TRIED])):
            smaller = refitted(problem, point, support - names)
            least, here = costs(problem, [smaller, point])
            if least <= here:
                point = smaller
                break
        else:
            return point
    return point


def joined(problem: Problem, point: Point) -> Point:
    """A point with one explanation for several where they hold alike: one dead band of
    both wheels for one of each."""
    for name, numbers in problem.terms.items():
        joins = [list(problem.joins.get(number, ())) for number in numbers]
        whole = {problem.rows[k].term for parts in joins for k in parts}
        if not all(joins) or not whole <= point.support:
            continue
        values = point.values.copy()
        for number, parts in zip(numbers, joins, strict=True):
            values[number] = values[parts].mean()
            values[parts] = problem.nominal[parts]
        support = (point.support - whole) | {name}
        other = fitted_at(problem, replace(point, values=values), support)
        least, here = costs(problem, [other, point])
        if least <= here:
            point = other
    return point


def parted(problem: Problem, point: Point) -> Point:
    """A point with one of two parts for an explanation that joins them and another one
    that undoes it on the other part: a larger right wheel for both larger and a lower
    gain of the left one.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    for name in sorted(point.support):
        numbers = problem.terms[name]
        joins = [list(problem.joins.get(number, ())) for number in numbers]
        if any(len(parts) != 2 for parts in joins):
            continue
        for gone, kept in ((0, 1), (1, 0)):
            undone = {problem.rows[parts[gone]].term for parts in joins}
            undoing = [
                other
                for other in sorted(point.support - {name})
                if max(point.linear.alike(other, part) for part in undone) > ALIKE
            ]
            for other in undoing:
                values = point.values.copy()
                rows = [parts[kept] for parts in joins]
                values[rows] = values[list(numbers)]
                back = [*numbers, *problem.terms[other]]
                values[back] = problem.nominal[back]
                support = (point.support - {name, other}) | {
                    problem.rows[row].term for row in rows
                }
                simpler = fitted_at(problem, replace(point, values=values), support)
                least, here = costs(problem, [simpler, point])
                if least <= here:
                    return simpler
    return point


def refitted(
    problem: Problem, point: Point, support: Support, *, near: bool = False
) -> Point:
    """A point with another set, fitted to the simulation.

    Args:
        problem: the recording.
        point: a fitted set.
        support: the other set.
        near: see `fitted_at`.
    """
    values = placed(problem, point.linear, support, point.values)
    return fitted_at(problem, replace(point, values=values), support, near=near)


def fitted_at(
    problem: Problem, point: Point, support: Iterable[str], *, near: bool = False
) -> Point:
    """A set fitted from a point's values, without what has no slope and came back to
    its nominal value.

    Args:
        problem: the recording.
        point: values and noise to start from.
        support: the set.
        near: so near to the point that its derivatives do: for a first look, since
            those of all rows are what costs time.
    """
    support = frozenset(support)
    fitted = _fitted(problem, support)
    most = 3 if problem.model.singly else STEPS
    values, rest = newton(problem, point.values, fitted, point.noise, turns=most)
    values, rest = levels.zoomed(problem, values, rest, support, point.noise)
    kept = point.slopes if near else None
    linear, known, slopes = linearised(problem, values, rest, point.noise, kept)
    return Point(values, support & set(linear.terms), rest, linear, slopes, known)


def _several(tried: Singles, found: Support, best: Point) -> Point:
    """The best point where a tangent finds several explanations: from a single one, and
    if that is not enough from those several, and from all where many depart."""
    problem = tried.problem
    points = _simple(tried) + [best] * bool(best.support)
    if not any(enough(point) for point in points):
        if not best.support:
            points.append(_followed(problem, tried.start, found))
        if problem.model.many:
            points.append(_from_all(problem, tried.start))
    return better(problem, points)


def enough(point: Point) -> bool:
    """Whether few explanations leave little more than all together do."""
    linear, support = point.linear, point.support
    whole = linear.squares(linear.free)
    return len(support) <= FEW and linear.squares(support) < ENOUGH * whole


def _followed(problem: Problem, start: Point, support: Support) -> Point:
    """A point from a set found by the tangent at the nominal model."""
    values = placed(problem, start.linear, support, start.values)
    return descend(problem, values, support, start.noise)


def _simple(tried: Singles) -> list[Point]:
    """Points from the best single explanation, and from it with a level on top."""
    problem, start, best = tried.problem, tried.start, tried.fitted[0]
    made = [descend(problem, best.values, {best.name}, start.noise)]
    if not enough(made[0]) and (both := _with_level(problem, best, start)):
        made.append(both)
    return made


def _alone(tried: Singles) -> Point:
    """From the single explanation that leaves least; nothing, if it is no better than
    the best of so many fits is by chance."""
    problem, start = tried.problem, tried.start
    if not tried.fitted:
        return start
    best = tried.fitted[0]
    found = descend(problem, best.values, {best.name}, start.noise)
    nominal, here = costs(problem, [start, found])
    return found if here + np.log(len(tried.fitted)) < nominal else start


def _with_level(problem: Problem, best: Single, start: Point) -> Point | None:
    """A point from a single explanation and a level on top of it: through a tangent
    that lacks the level, the rest of it looks like several others."""
    single = fitted_at(problem, replace(start, values=best.values), {best.name})
    level = levels.best(problem, single)
    if level is None or level.cost > single.cost - WORTH:
        return None
    return descend(problem, level.values, level.support, single.noise)


def _from_all(problem: Problem, start: Point) -> Point:
    """From everything at once: a step of the fit, linear again there, and so on; the
    derivatives of all rows are what costs time."""
    linear, known, values = start.linear, start.noise, start.values
    everything = set(linear.free) | fit.nuisances(problem)
    for _ in range(STEPS):
        values, rest = newton(problem, values, everything, known, turns=1)
        linear, known, _ = linearised(problem, values, rest, known)
    found = search.best(linear)[1]
    values = placed(problem, linear, found, values)
    return descend(problem, values, found, known)
