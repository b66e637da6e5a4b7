"""Sets of explanations that the data can hardly tell from the one that was found."""

from dataclasses import replace

import numpy as np

from bns.gap.decomposition import levels, refit, starts
from bns.gap.decomposition.evidence.linear import Support
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.singles import Singles

TIED = 3.0  # nats within which explanations tie: odds of 20 to 1
SEVERAL = 2  # explanations up to which levels are tried in place of one
KEPT = 3  # rivals that are looked at in full
MARGIN = 10.0  # nats that a first look may be worse


def tied(problem: Problem, point: Point, tried: Singles) -> list[Support]:
    """Sets that tie with a point's, itself first: one explanation is another.

    Args:
        problem: the recording.
        point: the fit.
        tried: single explanations that were fitted on the way.
    """
    if not point.support:
        return [point.support]
    found: dict[Support, float] = {}
    for cost, swapped in (
        *_smooth(point),
        *_covering(point),
        *_levels(problem, point),
        *_refitted(problem, point, tried),
    ):
        found[swapped] = min(cost, found.get(swapped, np.inf))
    return [point.support, *sorted(found, key=lambda s: (found[s], sorted(s)))]


def _refitted(
    problem: Problem, point: Point, tried: Singles
) -> list[tuple[float, Support]]:
    """Explanations in place of a single one, each fitted from where it was by itself: a
    tangent at the one tells little of another that is far from nominal, where large
    departures are no longer in proportion."""
    bent = problem.model.singly or problem.model.many
    if len(point.support) > 1 or problem.onset or not bent:
        return []
    clear = problem.model.many and starts.enough(problem, point, 1)
    fitted = tried.by_tangent if clear else tried.fitted
    most = min((one.height for one in fitted), default=0.0) + 2 * (TIED + MARGIN)
    near = [one for one in fitted if one.height < most]
    rivals = [one for one in near if one.name not in point.support][:KEPT]
    if not rivals:
        return []
    made = [
        refit.fitted_at(problem, replace(point, values=one.values), {one.name})
        for one in rivals
    ]
    here, *costs = refit.costs(problem, [point, *made])
    return [
        (cost - here, other.support)
        for cost, other in zip(costs, made, strict=True)
        if cost - here < TIED
    ]


def _smooth(point: Point) -> list[tuple[float, Support]]:
    """Swaps by the linear model, with the nats that they cost."""
    linear, support = point.linear, point.support
    here = linear.cost(support)
    outside = [name for name in linear.free if name not in support]
    swaps = [(support - {a}) | {b} for a in sorted(support) for b in outside]
    costs = [linear.cost(swapped) - here for swapped in swaps]
    return [
        (cost, swapped)
        for cost, swapped in zip(costs, swaps, strict=True)
        if cost < TIED
    ]


def _covering(point: Point) -> list[tuple[float, Support]]:
    """An explanation in place of those that it can be, if it leaves as little: that it
    has more numbers is no reason against a load where a centre of mass is off."""
    linear, support = point.linear, point.support
    here, found = linear.squares(support), []
    for name, covered in linear.covers.items():
        if name in support or not covered & support:
            continue
        swapped = (support - covered) | {name}
        cost = max(linear.squares(swapped) - here, 0.0) / 2
        if cost < TIED:
            found.append((float(cost), swapped))
    return found


def _levels(problem: Problem, point: Point) -> list[tuple[float, Support]]:
    """Swaps of a level, or of a single explanation, for a level of another one,
    simulated: a dead band that was felt once may as well be a wheel that stopped once,
    and a tangent at a gain tells nothing of a wheel that is stuck."""
    rough = {row.term for row in problem.rows if not row.smooth} & point.support
    names = point.support if len(point.support) == 1 else rough
    if len(point.support) > SEVERAL or not names:
        return []
    found: dict[Support, float] = {}
    for name in sorted(names):
        most = levels.TRIALS if name in rough else 1
        rivals = levels.instead(problem, point, {name}, most)
        rivals = [item for item in rivals if item[0] < TIED + MARGIN][:KEPT]
        again = [values for _, _, values in rivals]
        for cost, term, values in levels.compared(problem, point, again, None):
            cost = _zoomed(problem, point, term, values) if cost >= TIED else cost
            swapped = (point.support - {name}) | {term}
            if cost < min(TIED, found.get(swapped, np.inf)):
                found[swapped] = cost
    return [(cost, swapped) for swapped, cost in found.items()]


def _zoomed(problem: Problem, point: Point, term: str, values: np.ndarray) -> float:
    """Nats that a rival costs at its best value."""
    base, path = problem.predict([point.values, values], fine=False)
    rest = point.rest - (path - base)
    _, rest = levels.zoomed(problem, values, rest, {term}, point.noise)
    gain = point.noise.loss(rest) - point.noise.loss(point.rest)
    return float(gain / (2 * point.noise.lam))
