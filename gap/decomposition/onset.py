"""Damage that sets in: the trial from which an explanation holds."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.decomposition import descent, refit
from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.linear import KAPPA, Linear, Support
from bns.gap.decomposition.fit import Point, placed
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
        trial: number of that trial, in all runs of the recording.
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
    cuts = _cuts(problem)
    if not cuts:
        return None
    tries = []
    for point in (start, best):
        base = search.best(point.linear, start=best.support)[1]
        tries.append((*_best(point.linear, base, best.support, cuts), point, base))
    cost, cut, support, point, base = min(tries, key=lambda item: item[0])
    gain = point.linear.cost(base) - cost
    if gain <= WORTH or not _lasting(point.linear, base, cut, support):
        return None
    name, number = cut.name, cut.trial
    rows = [problem.rows[k].name for k in problem.terms[name]]
    split = replace(problem, onset=dict.fromkeys(rows, number))
    values = _values(split, point, cut, support)
    wanted = (support - {LATE}) | {name}
    late = descent.descend(split, values, wanted, best.noise)
    costs = refit.costs(split, [best, late])
    paid = np.log(len(cuts))
    if name not in late.support or costs[1] + paid + WORTH > costs[0]:
        return None
    place = problem.numbers.index(number)
    return split, late, Onset(name, place, number, float(costs[0] - costs[1] - paid))


@dataclass(frozen=True, eq=False)
class _Cut:
    """From when on an explanation holds.

    Attributes:
        trial: number of the first trial, in every run.
        on: the trials from then on, booleans ``(T,)``.
        paid: nats for having chosen among all moments.
        name: of the explanation, empty = any.
    """

    trial: int
    on: np.ndarray
    paid: float
    name: str = ""


def _cuts(problem: Problem) -> list[_Cut]:
    """The moments that are tried: two trials before each at least."""
    numbers = np.array(problem.numbers)
    found = [k for k in sorted({*problem.numbers}) if (numbers < k).sum() >= 2]
    return [_Cut(k, numbers >= k, float(np.log(len(found)))) for k in found]


def _late(linear: Linear, cut: _Cut) -> Linear:
    made = linear.since(cut.name, cut.on, LATE)
    return replace(made, penalty={**made.penalty, LATE: KAPPA + cut.paid})


def _best(
    linear: Linear, base: Support, support: Support, cuts: Sequence[_Cut]
) -> tuple[float, _Cut, Support]:
    """Cost, moment and set of the best explanation that sets in."""
    found: tuple[float, _Cut, Support] = (np.inf, cuts[0], frozenset())
    for name in linear.free:
        for each in cuts:
            cut = replace(each, name=name)
            late = _late(linear, cut)
            for other in {frozenset(), base - {name}, support - {name}}:
                if not other <= frozenset(late.free):
                    continue
                cost = late.cost(other | {LATE})
                if cost < found[0]:
                    found = (cost, cut, other | {LATE})
    return found


def _lasting(linear: Linear, base: Support, cut: _Cut, support: Support) -> bool:
    """Whether the date brings as much with each trial left out."""
    late = _late(linear, cut)
    count = len(linear.square)
    for out in range(count):
        kept = np.arange(count) != out
        without = search.best(linear.of_blocks(kept), start=base, quick=True)[0]
        if late.of_blocks(kept).cost(support) > without - WORTH:
            return False
    return True


def _values(problem: Problem, point: Point, cut: _Cut, support: Support) -> np.ndarray:
    """Values of the rows by the linear model, those that set in at theirs."""
    late = _late(point.linear, cut)
    found = late.solve(support)
    values = placed(problem, point.linear, support - {LATE}, point.values)
    for at, number in zip(late.terms[LATE], problem.terms[cut.name], strict=False):
        row = problem.rows[number]
        values[number] = row.nominal + found[at] * row.sd
    return np.clip(values, *problem.bounds)
