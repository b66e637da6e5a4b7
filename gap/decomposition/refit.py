"""A set of explanations fitted to the simulation, by damped Gauss-Newton steps, and
which of several is the best."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from functools import cached_property

import numpy as np

from bns.gap.decomposition import fit, levels
from bns.gap.decomposition.evidence import noise
from bns.gap.decomposition.evidence.linear import Linear, Support
from bns.gap.decomposition.evidence.spread import tail
from bns.gap.decomposition.fit import Noise, Point, linearised, placed
from bns.gap.decomposition.problem import Problem

STEPS = 5  # of a fit
LOOKS = 3  # steps of a first look, and of a walker
DAMPING = (0.0, 2.0, 20.0, 200.0)  # added to the curvature, in units of the prior
LONGEST = 4.0  # prior standard deviations of one step; of what is farther off, twice
# as far: a load may be many times what its link plausibly departs by
STILL = 0.02  # prior standard deviations below which a fit has converged
SHARES = (1.0, 0.5, 0.2)  # of the way to where a linear model leads
BACK = 8  # rows of a fit of which each is tried at its nominal value
LOST = 1e3  # predicted by a simulation that diverged
ROUNDING = 1e-6  # by which a fit may be worse
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
    first = near and problem.model.many
    most = LOOKS if problem.model.singly or first else STEPS
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


def nearer(
    problem: Problem, values: np.ndarray, support: Iterable[str], known: Noise
) -> np.ndarray:
    """Values ``(R,)``, or shares of the way to them from the nominal model where these
    leave less: what many explanations do is not the sum of what each does.

    Args:
        problem: the recording.
        values: that a linear model leads to, ``(R,)``.
        support: explanations that are in; rows set to a level keep it.
        known: noise.
    """
    if not problem.model.many:
        return values
    smooth = np.array([row.smooth and row.term in set(support) for row in problem.rows])
    whole = np.where(smooth, values - problem.nominal, 0.0)
    sets = [values - (1 - share) * whole for share in SHARES]
    here, *made = problem.predict([problem.nominal, *sets], fine=False)
    rest = np.nan_to_num(problem.gap)
    left = [known.loss(rest - np.nan_to_num(path - here, nan=LOST)) for path in made]
    return sets[int(np.argmin(left))]


def newton(
    problem: Problem,
    values: np.ndarray,
    support: Iterable[str],
    known: Noise,
    *,
    turns: int = 3,
    only: list[int] | None = None,
    slopes: Mapping[int, np.ndarray] | None = None,
) -> tuple[np.ndarray, np.ndarray]:
    """Most probable values of the rows of a set, the others as they are.

    Gauss-Newton on the pseudo-Huber loss with the priors, with Levenberg's damping in
    their units, within bounds.

    Args:
        problem: the recording.
        values: to start from, ``(R,)``.
        support: explanations that are fitted (nuisances are not, beside these).
        known: noise.
        turns: steps at most.
        only: trials that count, None = all; the others' residuals are left out.
        slopes: derivatives at these values, which do until the fit has moved by
            `fit.FAR`; None = taken.

    Returns:
        values, and residuals there ``(N, C)``.
    """
    part = problem if only is None else replace(problem, recorded=_kept(problem, only))
    names = [k for name in sorted(support) for k in problem.terms[name]]
    first = _rest(part, values, only)
    begun = values
    for fine in (True,) if problem.model.one_step else (False, True):
        values, rest = _descended(
            part, begun, first, names, known, turns, only, slopes, fine=fine
        )
        if fine or values is begun:
            break
        rest = _rest(part, values, only)
        sizes = [
            _height(part, *each, names, known)
            for each in ((begun, first), (values, rest))
        ]
        if sizes[1] <= sizes[0] + ROUNDING:
            break
    return values, rest


def _descended(
    part: Problem,
    values: np.ndarray,
    rest: np.ndarray,
    names: Sequence[int],
    known: Noise,
    turns: int,
    only: list[int] | None,
    slopes: Mapping[int, np.ndarray] | None,
    *,
    fine: bool,
) -> tuple[np.ndarray, np.ndarray]:
    """The steps of `newton`, of the rows `names`, from values and residuals.

    Args:
        fine: whether each is judged at the fine step; else by what it changes at the
            coarse one, which costs a quarter, or less, of the time.
    """
    at = values  # where slopes were taken
    for _ in range(turns):
        which = [
            k
            for k in names
            if part.rows[k].sloped(values[k]) and not part.rows[k].stepped
        ]
        if not which:
            break
        far = np.abs((values - at)[which] / part.sd[which]).max() > fit.FAR
        if slopes is None or far or any(k not in slopes for k in which):
            slopes, at = part.slopes(values, which, only=only), values
        here = _Here(part, values, rest, which, known, only, fine)
        moved = _step(here, slopes)
        if moved is None and at is not values:
            slopes = None  # were of elsewhere
            continue
        moved = moved or _back(here)
        if moved is None:
            break
        change = np.abs((moved[0] - values)[which] / part.sd[which]).max()
        values, rest = moved
        if change < STILL:
            break
    return values, rest


def _kept(problem: Problem, only: list[int]) -> np.ndarray:
    inside = np.isin(problem.trial, only)
    return np.where(inside[:, None], problem.recorded, np.nan)


def _rest(problem: Problem, values: np.ndarray, only: list[int] | None) -> np.ndarray:
    if only is None:
        return problem.residual(values)[0]
    (made,) = problem.predict([values], only=only)
    return np.where(problem.seen, problem.recorded - np.nan_to_num(made, nan=LOST), 0.0)


@dataclass(frozen=True, eq=False)
class _Here:
    """Where a fit has come, and what is left of values that it tries from there.

    Attributes:
        problem: the recording.
        values: of all rows, ``(R,)``.
        rest: residuals there, ``(N, C)``.
        which: numbers of the rows that are fitted.
        noise: what it is weighed by.
        only: trials that count, None = all.
        fine: whether what is left is simulated at the fine step; else it is what is
            left here, less what changes at the coarse one.
    """

    problem: Problem
    values: np.ndarray
    rest: np.ndarray
    which: Sequence[int]
    noise: Noise
    only: list[int] | None
    fine: bool

    @cached_property
    def height(self) -> float:
        """See `_height`."""
        return self._height(self.values, self.rest)

    def tried(self, values: np.ndarray) -> tuple[np.ndarray, float]:
        """What other values ``(R,)`` leave, ``(N, C)``, and their height."""
        if self.fine:
            left = _rest(self.problem, values, self.only)
        else:
            pair = [self.values, values]
            here, there = self.problem.predict(pair, fine=False, only=self.only)
            left = self.rest - np.nan_to_num(there - here, nan=LOST)
        return left, self._height(values, left)

    def _height(self, values: np.ndarray, rest: np.ndarray) -> float:
        return _height(self.problem, values, rest, self.which, self.noise)


def _step(
    here: _Here, slopes: Mapping[int, np.ndarray]
) -> tuple[np.ndarray, np.ndarray] | None:
    """One damped step that lowers the loss; None if there is none."""
    problem, known, which = here.problem, here.noise, np.array(here.which)
    weight = known.weights(here.rest, problem.seen).ravel()
    design = np.stack([known.innovations(slopes[k]).ravel() for k in which], axis=-1)
    design = design * problem.sd[which]
    flat, away = _departure(problem, here.values, which)
    free = np.array([not problem.rows[k].nuisance for k in which])
    wider = np.where(free, np.maximum(np.abs(away), 1.0), 1.0)
    held = (flat / wider) ** 2  # by their priors, see `tail`
    longest = np.maximum(LONGEST, wider)
    heavy = design * weight[:, None]
    curvature = heavy.T @ design / known.lam + np.diag(held)
    pull = heavy.T @ known.innovations(np.nan_to_num(here.rest)).ravel() / known.lam
    pull -= held * away / flat
    low, high = problem.bounds
    for damping in DAMPING:
        step = np.linalg.solve(curvature + damping * np.eye(len(which)), pull)
        step *= min(1.0, 1 / ((np.abs(step) / longest).max() + 1e-30))
        there = here.values.copy()
        there[which] += step * problem.sd[which]
        there = np.clip(there, low, high)
        left, height = here.tried(there)
        if height <= here.height + ROUNDING:
            return there, left
    return None


def _back(here: _Here) -> tuple[np.ndarray, np.ndarray] | None:
    """Values with one of some rows nominal again, if that lowers the loss: where a foot
    lands a step sooner or later slopes may lead nowhere. None if none does."""
    nominal, values = here.problem.nominal, here.values
    away = [k for k in here.which if values[k] != nominal[k]]
    if not 1 < len(away) <= BACK or not here.problem.model.many:
        return None
    best, least = None, here.height - ROUNDING
    for number in away:
        there = values.copy()
        there[number] = nominal[number]
        left, height = here.tried(there)
        if height < least:
            best, least = (there, left), height
    return best


def _departure(
    problem: Problem, values: np.ndarray, which: Sequence[int] | np.ndarray
) -> tuple[np.ndarray, np.ndarray]:
    """How strongly the prior holds each of some rows, and by how many of its deviations
    their values ``(R,)`` depart: what was found by its level has a flat prior."""
    which = np.asarray(which)
    flat = np.array([1.0 if problem.rows[k].smooth else 0.2 for k in which])
    return flat, flat * (values[which] - problem.nominal[which]) / problem.sd[which]


def _height(
    problem: Problem,
    values: np.ndarray,
    rest: np.ndarray,
    which: Sequence[int] | np.ndarray,
    known: Noise,
) -> float:
    """Twice minus the log probability of residuals ``(N, C)`` and of how far values
    ``(R,)`` of some rows depart."""
    _, far = _departure(problem, values, which)
    free = np.array([not problem.rows[k].nuisance for k in which])
    prior = float((far**2).sum()) + 2 * tail(far[free])
    return known.loss(rest) / known.lam + prior
