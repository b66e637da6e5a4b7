"""Starts over the whole range of what has no slope at the nominal: dead bands, limits,
lags that are long, wheels that stop."""

from collections.abc import Collection, Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.linear import KAPPA, Linear, Support, stretches
from bns.gap.decomposition.fit import Noise, Point
from bns.gap.decomposition.problem import Problem

FELT = 4.0  # weighted square of a change below which a level is not felt
NEAR = 15.0  # nats beyond the present cost within which levels are tried in full
MOST = 14  # levels that are tried in full on account of their cost
KINDS = 6  # further ones, the best level of other rows
SEARCHED = 6  # levels whose sets are searched
EACH = 2  # levels of one row among these
PROMISING = 6  # times as many as are wanted: those that are tried further
AT_ONCE = 60  # levels in one batch, which bounds the memory
PARTS = 6  # between two levels in a search for the best value
LOOKS = 4  # of it, each nearer, the last ones where the one before gained
TRIALS = 2  # in which an explanation is felt most, for a first look
GAIN = 0.5  # of the loss that a new value has to bring


@dataclass(frozen=True, eq=False)
class Level:
    """A row set to a value on top of a fit, with what evidence says goes with it.

    Attributes:
        name: of the row's explanation.
        cost: minus the log evidence of the set, with what a level costs.
        values: of all rows, ``(R,)``.
        support: the set.
    """

    name: str
    cost: float
    values: np.ndarray
    support: Support


def best(problem: Problem, point: Point) -> Level | None:
    """The level of highest evidence, everything else free; None if none is felt."""
    todo = [
        (number, value)
        for number, row in enumerate(problem.rows)
        for value in row.levels
        if (row.smooth or point.values[number] == row.nominal)
        and value != point.values[number]
    ]
    few = problem.sample()
    found = _scored(problem, point, todo, few)
    base = min(_weighed(problem, point, few).cost(s) for s in (point.support, ()))
    near = [item for item in found if item[0] < base + NEAR][:MOST]
    rows = {number for _, (number, _), _ in near}
    for item in found:
        if item[1][0] not in rows and len(near) < MOST + KINDS:
            near.append(item)
            rows.add(item[1][0])
    if len(few) < len(problem.trials):
        # what a first look does not feel may be felt elsewhere: slow commands are rare
        tried = {which for _, which, _ in found}
        unfelt = [w for w in todo if w not in tried and not problem.rows[w[0]].smooth]
        again = [*(which for _, which, _ in near), *unfelt]
        near = _scored(problem, point, again, None)
    made: list[Level] = []
    count: dict[int, int] = {}
    for _, (number, value), linear in near:
        count[number] = count.get(number, 0) + 1
        if count[number] <= EACH and len(made) < SEARCHED:
            made.append(_level(problem, point, number, value, linear))
    if not made:
        return None
    chosen = min(made, key=lambda level: level.cost)
    beside = problem.model.many and point.support - chosen.support
    return _nearest(problem, point, chosen) if beside else chosen


def _nearest(problem: Problem, point: Point, level: Level) -> Level:
    """A level, at the one of its row that leaves least beside its set: what was found
    before it, and is no longer, may have made another one look better."""
    (number, *_) = (n for n in problem.terms[level.name] if problem.rows[n].levels)
    row = problem.rows[number]
    if row.smooth:
        return level
    sets = _at(level.values, number, row.levels)
    found = compared(problem, point, sets, None)
    return replace(level, values=found[0][-1]) if found else level


def _at(values: np.ndarray, number: int, levels: Iterable[float]) -> list[np.ndarray]:
    """Values of all rows ``(R,)`` with one of them at each of some levels."""
    sets = []
    for level in levels:
        moved = values.copy()
        moved[number] = level
        sets.append(moved)
    return sets


def screened(
    problem: Problem,
    point: Point,
    most: int,
    only: list[int] | None = None,
    names: Collection[str] | None = None,
) -> list[tuple[str, np.ndarray]]:
    """Explanations that say most by themselves at one of their levels, or at one of the
    model's departures: where a tangent at the nominal says little.

    Args:
        problem: the recording.
        point: the nominal model.
        most: how many.
        only: trials that are looked at, None = all.
        names: of the explanations that are looked at, None = all.

    Returns:
        names and values of all rows, ``(R,)``, nuisances fitted; the best first.
    """
    rows = [
        number
        for number, row in enumerate(problem.rows)
        if not row.nuisance and (names is None or row.term in names)
    ]
    todo = _departures(problem, rows, problem.model.spread) | {
        (number, value)
        for number in rows
        for value in problem.rows[number].levels
        if value != problem.nominal[number]
    }
    best = _least(problem, point, todo, only)
    promising = set(_first(best, most * PROMISING))
    rows = [number for number in rows if problem.rows[number].term in promising]
    todo = _departures(problem, rows, problem.model.further)
    again = _least(problem, point, todo, only)
    for term, item in again.items():
        best[term] = min(best[term], item, key=lambda found: found[0])
    return [(term, best[term][1]) for term in _first(best, most)]


def _first(best: Mapping[str, tuple[float, np.ndarray]], most: int) -> list[str]:
    """Explanations that cost least, the best first."""
    return sorted(best, key=lambda term: best[term][0])[:most]


def _least(
    problem: Problem,
    point: Point,
    todo: Collection[tuple[int, float]],
    only: list[int] | None,
) -> dict[str, tuple[float, np.ndarray]]:
    """What explanations cost by themselves at the best of values of their rows, and the
    values of all rows ``(R,)``."""
    best: dict[str, tuple[float, np.ndarray]] = {}
    order = sorted(todo)
    for at in range(0, len(order), AT_ONCE):
        part = order[at : at + AT_ONCE]
        for _, (number, value), linear in _scored(problem, point, part, only):
            term = problem.rows[number].term
            cost, support = _by_itself(linear, term)
            if term not in best or cost < best[term][0]:
                values = _values(problem, point, number, value, linear, support)
                best[term] = cost, values
    return best


def _by_itself(linear: Linear, term: str) -> tuple[float, Support]:
    """Cost of a level with the other rows of its explanation free, if that is less."""
    free = dict.fromkeys((*linear.free, term))
    linear = replace(linear, free=tuple(free), _costs={})
    sets = [frozenset({term})] if term in linear.terms else []
    return min((linear.cost(item), item) for item in (frozenset[str](), *sets))


def _departures(
    problem: Problem, rows: Iterable[int], spread: Sequence[float]
) -> set[tuple[int, float]]:
    """Numbers of rows, and values as many plausible departures from the nominal."""
    found = set()
    for number in rows:
        row = problem.rows[number]
        for size in spread if row.sloped(row.nominal) else ():
            for value in (row.nominal - size * row.sd, row.nominal + size * row.sd):
                if row.low <= value <= row.high:
                    found.add((number, value))
    return found


def _level(
    problem: Problem, point: Point, number: int, value: float, linear: Linear
) -> Level:
    known = min((point.support, frozenset()), key=lambda s: linear.cost(_in(linear, s)))
    cost, support = search.best(linear, start=known, quick=True)
    row = problem.rows[number]
    values = _values(problem, point, number, value, linear, support)
    paid = cost + KAPPA + np.log(len(row.levels)) + 0.5
    return Level(row.term, float(paid), values, support | {row.term})


def _values(
    problem: Problem,
    point: Point,
    number: int,
    value: float,
    linear: Linear,
    support: Support,
) -> np.ndarray:
    """Values of all rows with a row at a level, the others by the linear model."""
    values = problem.nominal.copy()
    found = linear.solve(support)
    for at, column in enumerate(linear.columns):
        other = problem.rows[column]
        if not other.smooth and other.term in support:
            values[column] = point.values[column]
        elif other.smooth and (other.term in support or other.nuisance):
            values[column] += found[at] * other.sd
    values = np.clip(values, *problem.bounds)
    values[number] = value
    return values


def _in(linear: Linear, support: Support) -> Support:
    return support & frozenset(linear.free)


def _weighed(problem: Problem, point: Point, only: list[int] | None) -> Linear:
    """The linear model of some trials."""
    if only is None or len(only) == len(problem.trials):
        return point.linear
    inside = np.unique(problem.block[np.isin(problem.trial, only)])
    return point.linear.of_blocks(stretches(len(point.linear.square), inside))


def _scored(
    problem: Problem,
    point: Point,
    todo: Sequence[tuple[int, float]],
    only: list[int] | None,
) -> list[tuple[float, tuple[int, float], Linear]]:
    """Cost of each level with the present explanations or none, best first, with the
    linear model in which it is set."""
    if not todo:
        return []
    sets = [point.values]
    for number, value in todo:
        moved = point.values.copy()
        moved[number] = value
        sets.append(moved)
    base, *made = problem.predict(sets, fine=False, only=only)
    inside = None
    if only is not None and len(only) < len(problem.trials):
        blocks = np.unique(problem.block[np.isin(problem.trial, only)])
        inside = stretches(len(point.linear.square), blocks)
    found = []
    for which, path in zip(todo, made, strict=True):
        if not np.isfinite(path[problem.seen]).all():
            continue
        change = np.nan_to_num(path - base)
        number, _ = which
        if problem.rows[number].smooth:  # what it did before is in the target
            off = point.values[number] - problem.nominal[number]
            change = change + point.slopes[number] * off
        change = point.noise.innovations(change)
        if (point.linear.weight * change**2).sum() < FELT:
            continue
        term = problem.rows[number].term
        several = len(problem.terms[term]) > 1
        linear = point.linear.moved(change, drop="" if several else term)
        linear = linear if inside is None else linear.of_blocks(inside)
        costs = [linear.cost(_in(linear, s)) for s in (point.support, frozenset())]
        found.append((min(costs), which, linear))
    return sorted(found, key=lambda item: (item[0], item[1]))


def instead(
    problem: Problem, point: Point, gone: Collection[str], most: int = TRIALS
) -> list[tuple[float, str, np.ndarray]]:
    """Levels of other explanations in the place of some of a point, by a first look:
    nats, names and values of all rows, ``(R,)``, as `compared` gives them.

    Args:
        problem: the recording.
        point: the fit.
        gone: explanations that they stand for.
        most: trials that are looked at, those in which these are felt most.
    """
    bare = point.values.copy()
    numbers = [number for name in gone for number in problem.terms[name]]
    bare[numbers] = problem.nominal[numbers]
    sets = []
    for number, row in enumerate(problem.rows):
        if row.smooth or row.term in point.support:
            continue
        sets += _at(bare, number, row.levels)
    return compared(problem, point, sets, _felt(problem, point, bare, most))


def _felt(problem: Problem, point: Point, bare: np.ndarray, most: int) -> list[int]:
    """Trials in which is felt most what values ``(R,)`` lack."""
    here, there = problem.predict([point.values, bare], fine=False)
    squares = (point.linear.weight * np.nan_to_num(here - there) ** 2).sum(axis=1)
    sums = np.bincount(problem.trial, squares, minlength=len(problem.trials))
    order = np.argsort(-sums)[:most]
    return sorted(int(n) for n in order if sums[n] > FELT)


def compared(
    problem: Problem, point: Point, sets: Sequence[np.ndarray], only: list[int] | None
) -> list[tuple[float, str, np.ndarray]]:
    """Nats that sets of values cost beyond the point's, the best of each explanation,
    with that and the values; the best first.

    Args:
        problem: the recording.
        point: the fit.
        sets: values of all rows, ``(R,)`` each.
        only: trials that are looked at, None = all.
    """
    if not sets or only == []:
        return []
    base, *made = problem.predict([point.values, *sets], fine=False, only=only)
    here = point.noise.loss(point.rest)
    best: dict[str, tuple[float, str, np.ndarray]] = {}
    for values, path in zip(sets, made, strict=True):
        if not np.isfinite(path[problem.seen]).all():
            continue
        cost = point.noise.loss(point.rest - (path - base)) - here
        cost = float(cost / (2 * point.noise.lam))
        term = _moved(problem, point, values)
        if term not in best or cost < best[term][0]:
            best[term] = (cost, term, values)
    return sorted(best.values(), key=lambda item: item[:2])


def _moved(problem: Problem, point: Point, values: np.ndarray) -> str:
    """Name of the explanation that stands in."""
    moved = np.flatnonzero((values != problem.nominal) & (values != point.values))
    return problem.rows[moved[0]].term


def zoomed(
    problem: Problem,
    values: np.ndarray,
    rest: np.ndarray,
    support: Collection[str],
    known: Noise,
) -> tuple[np.ndarray, np.ndarray]:
    """The best values of rows set to levels, between the levels beside.

    Args:
        problem: the recording.
        values: of all rows, ``(R,)``.
        rest: residuals there, ``(N, C)``.
        support: explanations that are in; only their rows are tried.
        known: the noise.

    Returns:
        values and residuals.
    """
    for number, row in enumerate(problem.rows):
        inside = row.term in support and values[number] != row.nominal
        if inside and not row.smooth and len(row.levels) > 1:
            values, rest = _zoom(problem, values, rest, number, known)
    return values, rest


def _zoom(
    problem: Problem, values: np.ndarray, rest: np.ndarray, number: int, known: Noise
) -> tuple[np.ndarray, np.ndarray]:
    row = problem.rows[number]
    marks = np.unique([*row.levels, row.low, row.high])
    low = marks[marks < values[number]].max(initial=row.low)
    high = marks[marks > values[number]].min(initial=row.high)
    for look in range(LOOKS):
        before = values[number]
        sets = _at(values, number, np.linspace(low, high, PARTS)[1:-1])
        base, *made = problem.predict([values, *sets], fine=False)
        losses = [known.loss(rest - (path - base)) for path in made]
        at = int(np.argmin(losses))
        if losses[at] < known.loss(rest) - GAIN:
            left, _ = problem.residual(sets[at])
            if known.loss(left) < known.loss(rest):  # at the fine step as well
                values, rest = sets[at], left
        width = (high - low) / (PARTS - 1)
        low, high = max(values[number] - width, row.low), values[number] + width
        high = min(high, row.high)
        if look and values[number] == before:
            break
    return values, rest
