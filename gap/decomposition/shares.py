"""What each explanation of a fit closes, how sure it is, and what it ties with."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from itertools import combinations

import numpy as np

from bns.gap.decomposition import fit
from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.linear import KAPPA, Linear, Support
from bns.gap.decomposition.fit import Point
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.rest import by_trial

CHOICE = 4.0  # nats within which the held-out error decides
WITHIN = 2.5  # standard deviations of what a model is unsure by: no gap (assumed)
FEWEST = 3  # trials of which others may confirm one
CLEARLY = 0.02  # of the held-out error that a further explanation has to lower
PIECES = 4  # of a stretch, each left out by itself for the share that is closed
SLIGHT = 0.15  # of what is left: less may as well come from that,
TRIFLE = 1e-3  # of the gap, if it is less than this too: a thirtieth of its size
SMALL = 0.01  # of the gap: what closes less has to be this sure,
SURE = 8.0  # nats of evidence: a simulation by other steps may look like 7
CANCELLED = 5e-3  # of the gap: what explanations that cancel close at most
LEFT_OVER = 0.01  # of what they change by themselves, squared: the others undo it
LOOKED_AT = 8  # weakest explanations among which some may cancel
MOVED = 1e-6  # plausible departures
EXACT = 1e-3  # of the smallest deviation that is believed: no fit is more exact
ELSEWHERE = 0.05  # of what a level gains in its best trial: no more is nothing
AS_ELSEWHERE = 3.0  # times what is left in other trials: no more is noise
NINETY = 1.645  # standard deviations of a 90 % interval


@dataclass(frozen=True)
class Sized:
    """An explanation and how large it is.

    Attributes:
        name: of the explanation.
        values: of its rows, by name.
        low, high: 90 % intervals of these.
    """

    name: str
    values: dict[str, float]
    low: dict[str, float]
    high: dict[str, float]


@dataclass(frozen=True)
class Part(Sized):
    """One explanation among several.

    Attributes:
        last: share of the gap that goes when it is added last. The gap is all that
            the explanations close, and the rest too where that is more than scatter.
        alone: share that it closes by itself.
        sure: posterior probability that it is in.
    """

    last: float
    alone: float
    sure: float


def parts(problem: Problem, point: Point, *, lasting: bool = True) -> list[Part]:
    """Explanations of a point, the largest share first.

    Args:
        problem: the recording.
        point: a fitted set.
        lasting: whether what it leaves is more than scatter, and so a part of the gap.
    """
    linear, support = point.linear, point.support
    told = linear
    if point.noise.order or point.noise.latent.parts:  # shares are of the plain error
        told = HeldOut.of(problem, point).plain
    empty, full = frozenset[str](), frozenset(linear.free)
    none, every, left = (_height(told, names) for names in (empty, full, support))
    whole = max(none - (every if lasting else left), 1e-9)
    made = [
        Part(
            **vars(one),
            last=(_height(told, support - {one.name}) - left) / whole,
            alone=(none - _height(told, frozenset({one.name}))) / whole,
            sure=search.inclusion(linear, one.name),
        )
        for one in sized(problem, point)
    ]
    return sorted(made, key=lambda part: (-part.last, part.name))


def sized(problem: Problem, point: Point) -> list[Sized]:
    """Explanations of a point with values and intervals, by name.

    Args:
        problem: the recording.
        point: a fitted set.
    """
    place = {number: at for at, number in enumerate(point.linear.columns)}
    spread = NINETY * np.sqrt(np.diagonal(point.linear.covariance(point.support)))
    made = []
    for name in sorted(point.support):
        one = Sized(name, {}, {}, {})
        for number in problem.terms[name]:
            if number not in place:
                continue
            row, value = problem.rows[number], float(point.values[number])
            unit = row.sd if row.smooth else abs(value - row.nominal) or row.sd
            width = float(spread[place[number]] * unit)
            one.values[row.name] = value
            one.low[row.name] = max(value - width, float(row.low))
            one.high[row.name] = min(value + width, float(row.high))
        made.append(one)
    return made


@dataclass(frozen=True, eq=False)
class HeldOut:
    """Plain squared errors on stretches that were not fitted.

    Attributes:
        linear: what is fitted.
        plain: the same recording, every residual of a channel weighing the same.
        weight: of each residual in `plain`, ``(N, C)``; 0 = not seen.
        fixed: by explanation set to a level, what it changes as in `linear` and as in
            `plain`, ``(N, C)`` each: a level was chosen, it is not fitted again.
    """

    linear: Linear
    plain: Linear
    weight: np.ndarray
    fixed: Mapping[str, tuple[np.ndarray, np.ndarray]]

    @classmethod
    def of(
        cls,
        problem: Problem,
        point: Point,
        pieces: int = 1,
        inside: np.ndarray | None = None,
    ) -> "HeldOut":
        """For a point's linear model.

        Args:
            problem: the recording.
            point: the fit.
            pieces: how many parts of each stretch are left out by themselves. More than
                one lets an effect that shows in a single trial be fitted to a part of
                that trial; windows beside a cut overlap by half.
            inside: which residuals count, ``(N, C)``; None = all that were seen.
        """
        linear = point.linear
        if pieces > 1:
            problem = replace(problem, block=_pieces(problem.block, pieces))
            linear = linear.in_blocks(problem.block)
        sd = np.sqrt(np.nanmean(point.rest**2, axis=0))
        sd = np.maximum(sd, EXACT * problem.model.least)
        weight = np.where(problem.seen if inside is None else inside, 1 / sd**2, 0.0)
        units = fit.units(problem, point.values)
        whole = fit.target(problem, point.values, point.rest, point.slopes)
        plain = Linear.of(problem, point.slopes, units, whole, weight)
        fixed: dict[str, tuple[np.ndarray, np.ndarray]] = {}
        for number, slope in point.slopes.items():
            row = problem.rows[number]
            if not row.smooth:
                change = slope * (point.values[number] - row.nominal)
                one, other = fixed.get(row.term, (0.0, 0.0))
                change = (one + point.noise.innovations(change), other + change)
                fixed[row.term] = change
        return cls(linear, plain, weight, fixed)

    def nominal(self, rest: np.ndarray) -> float:
        """Squared error of the nominal model as it was simulated, whose residuals
        ``(N, C)`` are `rest`: slopes at the fit do not reach back to the nominal values
        of what is not smooth."""
        return float((self.weight * np.nan_to_num(rest) ** 2).sum())

    def floor(self, sd: np.ndarray, left: float) -> float:
        """Squared error of what measuring scatters: of each channel at most its part of
        what is left, lest one in which nothing departs makes up for what is left in
        another.

        Args:
            sd: what measuring scatters, ``(N, C)``.
            left: squared error of a set.
        """
        most = left / max((self.weight > 0).sum(), 1)
        return float(np.minimum(self.weight * sd**2, most * (self.weight > 0)).sum())

    def compared(self, rest: np.ndarray, support: Iterable[str]) -> tuple[float, float]:
        """Squared error of the nominal model, see `nominal`, and that of a set.

        Args:
            rest: residuals of the nominal model, ``(N, C)``, in the units of the
                channels.
            support: names of the explanations that are added.

        Returns:
            Both errors, in squares of the noise.
        """
        return self.nominal(rest), float(self.error(support).sum())

    def error(self, support: Iterable[str]) -> np.ndarray:
        """Squared error of each stretch, the rows fitted to the others, ``(B,)``."""
        linear, plain, fitted = self._levelled(support)
        return linear.held_out(fitted, plain)

    def loss(self, support: Support) -> float:
        """Squared error of all stretches, and what nuisances pay for it."""
        linear, _, fitted = self._levelled(support)
        paid = _paid(linear, linear.solve(fitted, slack=False))
        return float(self.error(support).sum()) + paid

    def _levelled(self, support: Iterable[str]) -> tuple[Linear, Linear, list[str]]:
        """Both models without what levels of a set change, and the rest of the set."""
        linear, plain, fitted = self.linear, self.plain, []
        for name in sorted(support):
            if name in self.fixed:
                linear = linear.moved(self.fixed[name][0])
                plain = plain.moved(self.fixed[name][1])
            else:
                fitted.append(name)
        return linear, plain, fitted


def _pieces(block: np.ndarray, count: int) -> np.ndarray:
    """Each stretch of windows ``(N,)`` cut into so many, numbered through."""
    made = np.empty_like(block)
    for number in np.unique(block):
        rows = np.flatnonzero(block == number)
        made[rows] = number * count + np.arange(len(rows)) * count // len(rows)
    return np.unique(made, return_inverse=True)[1]


def departing(problem: Problem, point: Point) -> Support:
    """The set of a point without what came back to its nominal values."""
    off = np.abs(point.values - problem.nominal) > MOVED * problem.sd
    return frozenset(n for n in point.support if off[list(problem.terms[n])].any())


def guarded(problem: Problem, point: Point) -> Support:
    """The set of a point without what makes the plain held-out error worse; of those
    within `CHOICE` nats by one change the one with the least. What nuisances pay counts
    as error: a shift of the clock beyond all reason is a delay."""
    if not point.support:
        return point.support
    held = HeldOut.of(problem, point)
    support = point.support
    near = [s for cost, s in search.near(point.linear, CHOICE) if len(s ^ support) <= 2]
    near = [s for s in near if len(s) <= len(support)]
    best = support
    if len(support) > 3:  # several at once: which of them is for the held-out error
        best = min([support, *near], key=held.loss)
        best = _grown(point.linear, held, best)
    while best:
        total = held.loss(best)
        without = {name: held.loss(best - {name}) for name in sorted(best)}
        name = min(without, key=without.__getitem__)
        if without[name] >= total:
            break
        best = best - {name}
    return best


def unconfirmed(problem: Problem, point: Point) -> dict[str, int]:
    """Levels of a point that gain in one of several trials alone, and its number.

    A level was chosen by that trial, and no other one says that it is right. Nor does
    what it leaves there, where that is more than is left in the other trials: an
    obstacle stops a robot not quite when a command begins.
    """
    levels = {row.term for row in problem.rows if not row.smooth} & point.support
    if not levels or len(problem.trials) < FEWEST:
        return {}
    held, rest, found = HeldOut.of(problem, point), np.nan_to_num(point.rest), {}
    left = (held.weight * rest**2).sum(axis=1)
    for name in sorted(levels & held.fixed.keys()):
        change = held.fixed[name][1]
        more = (held.weight * ((rest + change) ** 2 - rest**2)).sum(axis=1)
        gains = np.bincount(problem.trial, more)
        best = int(gains.argmax())
        if gains.sum() - gains[best] >= ELSEWHERE * gains[best]:
            continue
        inside = problem.trial == best
        changed = inside & ((held.weight * change**2).sum(axis=1) > 1)
        others = np.unique(problem.trial[~inside])
        usual = np.median(by_trial(problem, left)[others])
        if not changed.any() or left[changed].mean() > AS_ELSEWHERE * usual:
            found[name] = problem.numbers[best]
    return found


def within_slack(problem: Problem, point: Point) -> Problem:
    """A problem in which explanations of a point that are no gap are slack.

    The nominal model is unsure of their numbers, and lies hardly off by more.
    """
    off = np.abs(point.values - problem.nominal)
    found = {
        name
        for name, numbers in problem.terms.items()
        if name in point.support
        and all(off[n] <= WITHIN * problem.rows[n].unsure for n in numbers)
    }
    if not found:
        return problem
    rows = (
        replace(row, slack=row.unsure) if row.term in found else row
        for row in problem.rows
    )
    return replace(problem, rows=tuple(rows))


def weighty(problem: Problem, point: Point, left: float) -> Support:
    """The set of a point without trifles: what closes, added last, hardly any of the
    gap, and less than a part of what no explanation closes: that may look like it. So
    may the others, within what they are simulated to. Nor is in it what closes little
    beside a single other one, and is not sure, or less than is left; among several it
    may be what they lack.

    Args:
        problem: the recording.
        point: the fit.
        left: share of the gap that is left and is not scatter.
    """
    linear, support = point.linear, point.support
    least = max(min(SLIGHT * left, TRIFLE), fit.inexact(problem, point.values) ** 2)
    gap = linear.squares(()) - linear.squares(linear.free)
    while len(support) > 1:
        here, cost = _height(linear, support), linear.cost(support)
        without = {n: _height(linear, support - {n}) - here for n in sorted(support)}
        name = min(without, key=without.__getitem__)
        small = [n for n in without if without[n] < SMALL * gap]
        doubts = {
            n
            for n in small
            if without[n] < left * gap or linear.cost(support - {n}) < cost + SURE
        }
        if len(support - doubts) == 1:
            name = min(sorted(doubts), key=without.__getitem__)
        elif without[name] >= least * gap:
            break
        support = support - {name}
    return support - cancelling(linear, support)


def cancelling(linear: Linear, support: Support) -> Support:
    """Several explanations of a set that cancel: they change much, but the others undo
    it, and without them hardly any of the gap comes back. They are directions that the
    data see next to nothing of: a gain and a diameter, masses of two links. One alone
    is none: what a shift of the clock undoes may be a delay.

    Args:
        linear: around the fit.
        support: the set.
    """
    least = CANCELLED * (linear.squares(()) - linear.squares(linear.free))
    here = _height(linear, support)
    weak = {n: _height(linear, support - {n}) - here for n in sorted(support)}
    names = sorted(weak, key=weak.__getitem__)[:LOOKED_AT]
    names = [name for name in names if weak[name] < least and name in linear.terms]
    values = linear.solve(support, slack=False)
    for size in range(len(names), 1, -1):
        for some in map(frozenset, combinations(names, size)):
            back = _height(linear, support - some) - here
            each = sum(linear.square_of(values, {name}) for name in some)
            if some != support and back < min(least, LEFT_OVER * each):
                return some
    return frozenset()


def _height(linear: Linear, support: Support) -> float:
    """Weighted square of what a set leaves, and what nuisances pay for it: a delay is
    no trifle that only a shift beyond all reason makes up for."""
    values = linear.solve(support, slack=False)
    return linear.left(values) + _paid(linear, values)


def _paid(linear: Linear, values: np.ndarray) -> float:
    """What nuisances pay at values of all rows, ``(K,)``."""
    paid = values[linear.always]
    return linear.lam * float(paid @ paid)


def _grown(linear: Linear, held: HeldOut, support: Support) -> Support:
    """A set with what lowers its held-out error clearly, by more than its standard
    error, and has evidence but for its price."""
    while True:
        before, here = held.error(support), linear.cost(support)
        more = [support | {n} for n in linear.free if n not in support]
        more = [s for s in more if linear.cost(s) < here + KAPPA - 1e-6]
        errors = {s: held.error(s) for s in more}
        best = min(errors, key=lambda s: errors[s].sum(), default=support)
        gain = before - errors.get(best, before)
        if gain.sum() < max(CLEARLY * before.sum(), np.sqrt((gain**2).sum())):
            return support
        support = best
