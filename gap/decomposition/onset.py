"""Damage that sets in: the trial from which an explanation holds."""

from dataclasses import dataclass, replace

import numpy as np

from bns.gap.decomposition import descent
from bns.gap.decomposition.fit import Point, placed
from bns.gap.decomposition.linear import KAPPA, Linear, Support
from bns.gap.decomposition.problem import Problem

WORTH = 3.0  # nats that a date has to bring, with each trial left out as well
TRIALS = 5  # below which nothing is dated
LATE = "@"


@dataclass(frozen=True, eq=False)
class Onset:
    """An explanation that holds from a trial on.

    Attributes:
        name: of the explanation.
        place: of the first trial in which it holds.
        trial: number of that trial.
        gain: nats that the date brings.
    """

    name: str
    place: int
    trial: int
    gain: float


def dated(
    problem: Problem, start: Point, best: Point
) -> tuple[Problem, Point, Onset] | None:
    """The recording split where an explanation sets in, fitted again; None: none does.

    On the linear models at the nominal and at the best fit each explanation is tried
    from each trial on; moments are as many hypotheses more. The best is fitted to the
    simulation and kept if the evidence stays higher.

    Args:
        problem: the recording, a stretch a trial.
        start: the nominal model.
        best: the fit in which everything holds throughout.
    """
    count = len(problem.trials)
    if count < TRIALS or int(problem.block.max()) + 1 != count:
        return None
    tries = []
    for point in (start, best):
        base = point.linear.search(start=best.support)[1]
        tries.append((*_best(point.linear, base, best.support), point, base))
    cost, name, place, support, point, base = min(tries, key=lambda item: item[0])
    gain = point.linear.cost(base) - cost
    if gain <= WORTH or not _lasting(point.linear, base, name, place, support):
        return None
    rows = [problem.rows[k].name for k in problem.terms[name]]
    number = problem.numbers[place]
    split = replace(problem, onset=dict.fromkeys(rows, number))
    values = _values(split, point, name, place, support)
    wanted = (support - {LATE}) | {name}
    late = descent.descend(split, values, wanted, best.noise)
    costs = descent.costs(split, [best, late])
    paid = np.log(count - 2)
    if name not in late.support or costs[1] + paid + WORTH > costs[0]:
        return None
    return split, late, Onset(name, place, number, float(costs[0] - costs[1] - paid))


def _late(linear: Linear, name: str, place: int) -> Linear:
    made = linear.since(name, place, LATE)
    count = len(linear.square)
    return replace(made, penalty={**made.penalty, LATE: KAPPA + np.log(count - 2)})


def _best(linear: Linear, base: Support, support: Support):
    """Cost, name, place and set of the best explanation that sets in."""
    found = (np.inf, "", 0, frozenset())
    for name in linear.free:
        for place in range(2, len(linear.square)):
            late = _late(linear, name, place)
            for other in {frozenset(), base - {name}, support - {name}}:
                if not other <= frozenset(late.free):
                    continue
                cost = late.cost(other | {LATE})
                if cost < found[0]:
                    found = (cost, name, place, other | {LATE})
    return found


def _lasting(linear: Linear, base, name: str, place: int, support: Support) -> bool:
    """Whether the date brings as much with each trial left out."""
    late = _late(linear, name, place)
    count = len(linear.square)
    for out in range(count):
        kept = np.arange(count) != out
        without = linear.of_blocks(kept).search(start=base, quick=True)[0]
        if late.of_blocks(kept).cost(support) > without - WORTH:
            return False
    return True


def _values(problem: Problem, point: Point, name: str, place: int, support: Support):
    """Values of the rows by the linear model, those that set in at theirs."""
    late = _late(point.linear, name, place)
    found = late.solve(support)
    values = placed(problem, point.linear, support - {LATE}, point.values)
    for at, number in zip(late.terms[LATE], problem.terms[name], strict=False):
        row = problem.rows[number]
        values[number] = row.nominal + found[at] * row.sd
    return np.clip(values, *problem.bounds)
