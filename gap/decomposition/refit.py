"""A set of explanations fitted to the simulation, and which of several is the best."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np

from bns.gap.decomposition import fit, levels, noise
from bns.gap.decomposition.fit import Noise, Point, linearised, placed
from bns.gap.decomposition.linear import Linear, Support
from bns.gap.decomposition.newton import newton
from bns.gap.decomposition.problem import Problem

STEPS = 5  # of a fit; a walker, whose contacts make steps dear, takes fewer
REWEIGHED = 2  # times that residuals are weighed by what is left of them


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
    fitted = set(support) | fit.nuisances(problem)
    most = 3 if problem.model.singly else STEPS
    values, rest = newton(problem, point.values, fitted, point.noise, turns=most)
    values, rest = levels.zoomed(problem, values, rest, support, point.noise)
    kept = point.slopes if near else None
    if problem.model.many and not near:
        kept = fit.lasting(problem, point, support, values)
    linear, known, slopes = linearised(problem, values, rest, point.noise, kept)
    at = values if kept is None else point.at
    inside = support & set(linear.terms)
    return Point(values, inside, rest, linear, slopes, known, at)


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
        size = (np.log(known.sd[problem.seen]).sum() + known.latent.size) / lam
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
    told = known.latent.of_each(point.slopes)
    design = {number: known.memory(slope) for number, slope in told.items()}
    units = fit.units(problem, point.values)
    weight = known.weights(point.rest, problem.seen)
    for _ in range(REWEIGHED):
        made = Linear.of(problem, design, units, whole, weight).correlated(known.lam)
        left = made.rest(made.solve(point.support))
        weight = noise.weights(left, known.sd, problem.seen)
    return Linear.of(problem, design, units, whole, weight).correlated(known.lam)
