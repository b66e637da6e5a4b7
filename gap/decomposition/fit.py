"""Points of the fit: the problem made linear around values, and the noise there."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace

import numpy as np

from bns.gap.decomposition.evidence import noise
from bns.gap.decomposition.evidence.latent import Latent
from bns.gap.decomposition.evidence.linear import Linear, Support
from bns.gap.decomposition.evidence.noise import Memory
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row

FAR = 0.3  # prior standard deviations beyond which slopes are taken anew
MOVED = 0.5  # the same for what is not in, where many may depart
WATCHED = 16  # explanations beside those that are in whose slopes are taken anew there
APART = 0.25  # plausible departures from which it counts how exact a row is simulated
MEASURED = 4  # times that noise is measured from what it leaves
SILENT = 1e-3  # weighted square of what a plausible departure changes: no evidence
ROUGH = 20.0  # [s] of recording for comparing these


@dataclass(frozen=True, eq=False)
class Noise:
    """What the residuals scatter.

    Attributes:
        sd: of each, ``(N, C)``, once the latent numbers and memory are taken out.
        latent: what is not known of each trial, and what it may make of them.
        memory: their autoregression.
        lam: how many count as one.
    """

    sd: np.ndarray
    latent: Latent
    memory: Memory
    lam: float

    def innovations(self, values: np.ndarray) -> np.ndarray:
        """Residuals or slopes ``(N, C)`` without what the latent numbers and memory
        explain."""
        return self.memory(self.latent(values))

    @property
    def order(self) -> int:
        """Order of the autoregression."""
        return self.memory.factors.shape[1]

    def loss(self, rest: np.ndarray) -> float:
        """Pseudo-Huber loss of residuals ``(N, C)``."""
        return noise.loss(self.innovations(np.nan_to_num(rest)), self.sd)

    def weights(self, rest: np.ndarray, seen: np.ndarray) -> np.ndarray:
        """Weights of the squares, ``(N, C)``."""
        return noise.weights(self.innovations(np.nan_to_num(rest)), self.sd, seen)


@dataclass(frozen=True, eq=False)
class Point:
    """A fitted set of explanations.

    Attributes:
        values: of all rows, ``(R,)``.
        support: explanations that are in.
        rest: recorded minus predicted features, ``(N, C)``.
        linear: the problem made linear there.
        slopes: derivatives by row, ``(N, C)`` each.
        noise: what it leaves.
        at: values at which most derivatives were taken, ``(R,)``.
    """

    values: np.ndarray
    support: Support
    rest: np.ndarray
    linear: Linear
    slopes: Mapping[int, np.ndarray]
    noise: Noise
    at: np.ndarray

    @property
    def cost(self) -> float:
        """Minus the log evidence of its support."""
        return self.linear.cost(self.support)


def smooth(problem: Problem, values: np.ndarray) -> list[int]:
    """Rows that have a column at values ``(R,)``: those with a slope, those set to a
    level. A nuisance that is at its bound has none: it cannot do more."""
    return [
        number
        for number, row in enumerate(problem.rows)
        if row.sloped(values[number])
        and not (row.nuisance and not row.low < values[number] < row.high)
    ]


def columns(
    problem: Problem, values: np.ndarray, wanted: Sequence[int]
) -> dict[int, np.ndarray]:
    """Columns of the linear model; a row set to a level has its secant from nominal.

    Args:
        problem: the recording.
        values: of all rows, ``(R,)``.
        wanted: numbers of the rows, of those that `smooth` gives.

    Returns:
        by number of the row, each ``(N, C)``.
    """
    made = problem.slopes(values, [k for k in wanted if problem.rows[k].smooth])
    for number in wanted:
        if not problem.rows[number].smooth:
            made[number] = secant(problem, values, number)
    return made


def secant(problem: Problem, values: np.ndarray, number: int) -> np.ndarray:
    """Change of the features from nominal to a row's value, over that of the row.

    Args:
        problem: the recording.
        values: of all rows, ``(R,)``.
        number: of the row; its value is not the nominal one.

    Returns:
        ``(N, C)``; 0 where it is not a number.
    """
    without = values.copy()
    without[number] = problem.nominal[number]
    here, there = problem.predict([values, without], fine=False)
    return np.nan_to_num((here - there) / (values[number] - without[number]))


def units(problem: Problem, values: np.ndarray) -> dict[int, float]:
    """Standard deviation of each row's prior. That of a row set to a level is the size
    of its departure: what it may be is told by its levels."""
    return {
        number: row.sd if row.smooth else abs(values[number] - row.nominal) or row.sd
        for number, row in enumerate(problem.rows)
    }


def target(
    problem: Problem, values: np.ndarray, rest: np.ndarray, slopes: Mapping
) -> np.ndarray:
    """Residuals of the nominal model by the linear one, ``(N, C)``.

    Args:
        problem: the recording.
        values: of all rows, ``(R,)``.
        rest: residuals there, ``(N, C)``; those not seen count as zero.
        slopes: derivatives by number of the row, each ``(N, C)``.
    """
    made = np.nan_to_num(rest)
    for number, slope in slopes.items():
        made = made + slope * (values[number] - problem.nominal[number])
    return made


def first_noise(problem: Problem, rest: np.ndarray, motion: np.ndarray) -> Noise:
    """A guess before any fit.

    Args:
        problem: the recording.
        rest: residuals, ``(N, C)``.
        motion: predicted features, with whose motion noise may grow, ``(N, C)``.
    """
    memory = Memory.none(problem.trial, rest.shape[1])
    latent = Latent.of(problem, problem.nominal, rest)
    left = np.where(problem.seen, latent(np.nan_to_num(rest)), np.nan)
    sd = noise.scale(left, problem.model.motion(motion), problem.model.least)
    return Noise(sd, latent, memory, 2.0)


def linearised(
    problem: Problem,
    values: np.ndarray,
    rest: np.ndarray,
    known: Noise,
    slopes: Mapping[int, np.ndarray] | None = None,
    order: int | None = None,
) -> tuple[Linear, Noise, Mapping[int, np.ndarray]]:
    """The linear model around values, with the noise that all rows together leave. What
    explanations and slack change is simulated to a share of it (`inexact`).

    Args:
        problem: the recording.
        values: of all rows.
        rest: residuals there.
        known: noise to start from.
        slopes: derivatives from before, those that lack are taken; None = all are
            taken anew.
        order: of the autoregression, None = as in the noise.

    Returns:
        the linear model; the noise; derivatives by number of the row, each ``(N, C)``.
    """
    order = known.order if order is None else order
    wanted = smooth(problem, values)
    if slopes is None:
        known = replace(known, latent=Latent.of(problem, values, rest))
    kept = {k: slopes[k] for k in wanted if k in slopes} if slopes else {}
    lacking = [k for k in wanted if k not in kept]
    slopes = kept | (columns(problem, values, lacking) if lacking else {})
    whole = target(problem, values, rest, slopes)
    predicted = np.where(problem.seen, problem.recorded, 0.0) - np.nan_to_num(rest)
    motion = problem.model.motion(predicted)
    plain, inside = np.nan_to_num(problem.gap), _departed(problem, values)
    exact = inexact(problem, values)
    left, told = rest, known.latent.of_each(slopes)
    for turn in range(MEASURED):
        latent = known.latent.beside(problem, left)
        if latent is not known.latent:
            known, told = replace(known, latent=latent), latent.of_each(slopes)
        made = _linear(problem, values, told, whole, known, left)
        found = made.solve(made.free)
        left = whole - _summed(problem, values, slopes, made, found)
        if order and turn < MEASURED - 1:
            memory = Memory.of(known.latent(left), problem.trial, order)
            known = replace(known, memory=memory)
        seen = np.where(problem.seen, known.innovations(left), np.nan)
        explained = _summed(problem, values, slopes, made, made.solve(inside))
        change = np.abs(known.innovations(plain - whole + explained))
        felt = None if problem.model.many else change
        sd = noise.scale(seen, motion, problem.model.least, felt)
        known = replace(known, sd=np.hypot(sd, exact * change), lam=1.0)
    made = _linear(problem, values, told, whole, known, left)
    found = made.solve(made.free)
    whitened = np.sqrt(made.weight) * made.rest(found)
    lam = max(noise.correlated(whitened, problem.trial), noise.inflation(made, found))
    return made.correlated(lam), replace(known, lam=lam), slopes


def _departed(problem: Problem, values: np.ndarray) -> set[str]:
    """Names of explanations whose values ``(R,)`` are not nominal."""
    return {
        row.term
        for row, value in zip(problem.rows, values, strict=True)
        if value != row.nominal and not row.nuisance
    }


def inexact(problem: Problem, values: np.ndarray) -> float:
    """Share of what values ``(R,)`` change to which they are simulated: another
    integrator, or another law of friction, is no second effect."""
    rows = problem.rows
    away = np.abs(values - problem.nominal) > APART * problem.sd
    mine = (row.inexact for row, far in zip(rows, away, strict=True) if far)
    return max(mine, default=Row.inexact)


def _linear(
    problem: Problem,
    values: np.ndarray,
    told: Mapping[int, np.ndarray],
    whole: np.ndarray,
    known: Noise,
    left: np.ndarray,
) -> Linear:
    design = {number: known.memory(slope) for number, slope in told.items()}
    weight = known.weights(left, problem.seen)
    return Linear.of(
        problem, design, units(problem, values), known.innovations(whole), weight
    )


def _summed(
    problem: Problem,
    values: np.ndarray,
    slopes: Mapping[int, np.ndarray],
    made: Linear,
    found: np.ndarray,
) -> np.ndarray:
    sizes = units(problem, values)
    total = np.zeros_like(problem.recorded)
    for number, value in zip(made.columns, found, strict=True):
        if value:
            total += slopes[number] * sizes[number] * value
    return total


def placed(
    problem: Problem, linear: Linear, support: Iterable[str], values: np.ndarray
) -> np.ndarray:
    """Values of a set by the linear model, ``(R,)``; rows set to a level keep it.

    Args:
        problem: the recording.
        linear: the problem made linear.
        support: the set of explanations.
        values: of all rows, ``(R,)``, for the rows set to a level.
    """
    support = frozenset(support)
    found = linear.solve(support)
    made = problem.nominal.copy()
    for at, number in enumerate(linear.columns):
        row = problem.rows[number]
        if row.smooth and (row.term in support or row.nuisance):
            made[number] += found[at] * row.sd
        elif not row.smooth and row.term in support:
            made[number] = values[number]
    return np.clip(made, *problem.bounds)


def lasting(
    problem: Problem, point: Point, support: Iterable[str], values: np.ndarray
) -> Mapping[int, np.ndarray] | None:
    """A point's derivatives that are kept at other values: all if these are next to
    where they were taken; where many may depart those of what is not in, and if they
    are far of what promises little beside it, since taking all of them is what costs
    time (`descent` takes all near its best point). None = none are kept.

    Args:
        problem: the recording.
        point: whose derivatives.
        support: explanations that are in at the other values.
        values: of all rows, ``(R,)``.
    """
    away = np.abs((values - point.at) / problem.sd).max()
    if away <= FAR:
        return point.slopes
    if not problem.model.many:
        return None
    support, linear = frozenset(support), point.linear
    anew = {*support, *nuisances(problem)}
    if away > MOVED:
        known = support & linear.terms.keys()
        others = sorted(set(linear.free) - anew)
        anew |= {*sorted(others, key=lambda n: linear.cost(known | {n}))[:WATCHED]}
    inside = {k for name in anew for k in problem.terms[name]}
    return {k: slope for k, slope in point.slopes.items() if k not in inside}


def nuisances(problem: Problem) -> set[str]:
    """Names of what is always fitted."""
    return {row.term for row in problem.rows if row.nuisance}


def silent(problem: Problem, start: Point) -> frozenset[str]:
    """Names of rows of explanations that change next to nothing as far as they may
    plausibly depart: of joints that no command moves, in a model of one's own. One of
    several numbers of an explanation is none: where a load sits does nothing until
    there is one.

    Args:
        problem: the recording.
        start: the nominal model.
    """
    changed = {
        number: float((start.linear.weight * (slope * problem.sd[number]) ** 2).sum())
        for number, slope in start.slopes.items()
        if problem.rows[number].smooth and problem.model.many
    }
    return frozenset(
        problem.rows[number].name
        for numbers in problem.terms.values()
        if all(changed.get(number, 1.0) < SILENT for number in numbers)
        for number in numbers
    )
