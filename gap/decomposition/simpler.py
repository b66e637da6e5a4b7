"""A fitted set made simpler: one explanation for several, another one in the place of
one, and none that the others do as well."""

from collections.abc import Iterable, Iterator
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit, levels, refit
from bns.gap.decomposition.evidence.linear import Linear
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem

WEAK = 0.05  # of what a set explains: so little may be left to the others
TRIED = 3  # of these, the weakest first
SWAPPED = 30.0  # nats that another set may be worse by the linear model, to be fitted
UNITED = 2  # levels that are fitted in place of two explanations
SLIGHT = 0.25  # of a plausible departure: next to none
SAME = 0.98  # cosine of what two explanations change, from which they are tied
RIVALS = 2  # explanations that are tried in the place of another
ALIKE = 0.4  # cosine of what two explanations change, from which one may undo the other


def simplest(problem: Problem, point: Point) -> Point:
    """A point, or a simpler one that is as good.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    point = narrowed(problem, point)
    if problem.model.many:
        return swapped(problem, spared(problem, parted(problem, point)))
    return pruned(problem, point)


def spared(problem: Problem, point: Point) -> Point:
    """A point without what the others explain as well once they are fitted again, if
    that is hardly any of it: a load on a hand is not half on the link before it.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    for name in _weak(point)[:TRIED]:
        smaller = refit.refitted(problem, point, point.support - {name}, near=True)
        if smaller.support and _as_good(problem, smaller, point):
            return refit.fitted_at(problem, smaller, smaller.support)
    return point


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
        refit.refitted(problem, point, frozenset(swap), near=True)
        for cost, swap in near
        if cost < worst
    ]
    best = refit.better(problem, [point, *others])
    return best if best is point else refit.fitted_at(problem, best, best.support)


def narrowed(problem: Problem, point: Point) -> Point:
    """A point with what an explanation covers in its place where that is as good: a
    shifted centre of mass for a load of next to no mass.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    for name, covered in _covered(problem, point, later=False):
        support = (point.support - {name}) | set(covered)
        other = refit.refitted(problem, point, support)
        point = other if _as_good(problem, other, point) else point
    return point


def renamed(problem: Problem, point: Point) -> Point:
    """A point with what is looked at for that alone (`Row.later`) in the place of
    others where it is as good: as few as do of what an explanation covers, a centre of
    mass that lies elsewhere along one axis for a load of next to no mass; and one for
    two that it joins, a weak motor for both gains of its servo.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    for number, parts in problem.joins.items():
        row, whole = problem.rows[number], {problem.rows[k].term for k in parts}
        if row.later and whole <= point.support:
            values = point.values.copy()
            values[number] = float(np.mean(values[list(parts)]))
            values[list(parts)] = problem.nominal[list(parts)]
            begun = replace(point, values=values)
            other = refit.fitted_at(problem, begun, point.support - whole | {row.term})
            point = other if _as_good(problem, other, point) else point
    for name, covered in _covered(problem, point, later=True):
        others = (point.support - {name}) & set(point.linear.terms)
        mine = {problem.rows[k].name: point.values[k] for k in problem.terms[name]}
        same = problem.model.covered(name, mine)
        where = {term: problem.terms[term][0] for term in covered}
        order = sorted(covered, key=lambda n: -abs(same[n]) / problem.sd[where[n]])
        for count in range(1, len(order) + 1):
            values = fit.placed(problem, point.linear, others, point.values)
            for term in order[:count]:
                values[where[term]] = same[term]
            begun, support = replace(point, values=values), {*others, *order[:count]}
            other = refit.fitted_at(problem, begun, support)
            if _as_good(problem, other, point):
                point = other
                break
    return point


def _covered(
    problem: Problem, point: Point, *, later: bool
) -> Iterator[tuple[str, list[str]]]:
    """Explanations of a point whose first number departs next to nothing, and what they
    cover; of what is looked at in their place alone, or of the rest."""
    for name in sorted(point.support & set(point.linear.covers)):
        first = problem.terms[name][0]
        off = point.values[first] - problem.nominal[first]
        covered = [
            term
            for term in sorted(point.linear.covers[name] & set(problem.terms))
            if problem.rows[problem.terms[term][0]].later == later
        ]
        if covered and abs(off) < SLIGHT * problem.sd[first]:
            yield name, covered


def pruned(problem: Problem, point: Point) -> Point:
    """A point without what the others explain as well once they are fitted again: what
    is strong and not linear leaves that to small ones beside it.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    point = united(problem, parted(problem, joined(problem, point)))
    while len(point.support) > 1:
        support, weak = point.support, _weak(point)
        several = not problem.model.singly and 1 < len(weak) < len(support)
        together = [set(weak)] if several else []
        for names in (*together, *({name} for name in weak[:TRIED])):
            smaller = refit.refitted(problem, point, support - names)
            if _as_good(problem, smaller, point):
                point = smaller
                break
        else:
            return point
    return point


def _weak(point: Point) -> list[str]:
    """Explanations without which little less is explained, the weakest first."""
    linear, support = point.linear, point.support
    whole = max(linear.squares(()) - linear.squares(support), 1e-9)
    last = {
        name: (linear.squares(support - {name}) - linear.squares(support)) / whole
        for name in support
    }
    return sorted((n for n in last if last[n] < WEAK), key=lambda n: (last[n], n))


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
        other = refit.fitted_at(problem, replace(point, values=values), support)
        if _as_good(problem, other, point):
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
    for name, other, rows in _halves(problem, point):
        numbers = list(problem.terms[name])
        values = point.values.copy()
        values[rows] = values[numbers]
        back = [*numbers, *problem.terms[other]]
        values[back] = problem.nominal[back]
        parts = {problem.rows[row].term for row in rows}
        support = (point.support - {name, other}) | parts
        half = refit.fitted_at(
            problem, replace(point, values=values), support, near=problem.model.many
        )
        if _as_good(problem, half, point):
            return half
    return point


def united(problem: Problem, point: Point) -> Point:
    """A point with a level of another explanation for a level and one beside it that
    changes alike: a wheel stuck at its least speed for one stuck at its highest and a
    lower gain.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    rough = {row.term for row in problem.rows if not row.smooth} & point.support
    for name in sorted(rough):
        for other in sorted(point.support - {name}):
            if point.linear.alike(name, other) < ALIKE:
                continue
            rivals = levels.instead(problem, point, (name, other))[:UNITED]
            for _, term, values in rivals:
                support = (point.support - {name, other}) | {term}
                one = refit.fitted_at(problem, replace(point, values=values), support)
                if _as_good(problem, one, point):
                    return one
    return point


def _halves(problem: Problem, point: Point) -> Iterator[tuple[str, str, list[int]]]:
    """An explanation that joins two parts, another one that may undo it on one of
    them, and the rows of the other part."""
    for name in sorted(point.support):
        joins = [problem.joins.get(number, ()) for number in problem.terms[name]]
        if any(len(parts) != 2 for parts in joins):
            continue
        for gone, kept in ((0, 1), (1, 0)):
            undone = {problem.rows[parts[gone]].term for parts in joins}
            for other in sorted(point.support - {name}):
                if max(point.linear.alike(other, part) for part in undone) > ALIKE:
                    yield name, other, [parts[kept] for parts in joins]


def _as_good(problem: Problem, other: Point, point: Point) -> bool:
    """Whether a simpler point has at least the evidence of another one."""
    least, here = refit.costs(problem, [other, point])
    return least <= here


def rivals(linear: Linear, name: str, others: Iterable[str]) -> list[str]:
    """Names of the explanations that change most alike to one, but not the same: what
    does is tied to it.

    Args:
        linear: the problem made linear.
        name: of the explanation.
        others: that may be.
    """
    sizes = sorted((linear.alike(other, name), other) for other in others)
    near = [n for size, n in sizes if ALIKE <= size < SAME]
    return near[-RIVALS:]
