"""Damped Gauss-Newton steps, which fit the rows of a set to the simulation."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bns.gap.decomposition.fit import Noise
from bns.gap.decomposition.linear import tail
from bns.gap.decomposition.problem import Problem

DAMPING = (0.0, 2.0, 20.0, 200.0)  # added to the curvature, in units of the prior
LONGEST = 4.0  # prior standard deviations of one step
STILL = 0.02  # prior standard deviations below which a fit has converged


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
        slopes: derivatives at these values, for the first step; None = taken.

    Returns:
        values, and residuals there ``(N, C)``.
    """
    part = problem if only is None else replace(problem, recorded=_kept(problem, only))
    names = [k for name in sorted(support) for k in problem.terms[name]]
    rest = _rest(part, values, only)
    for _ in range(turns):
        which = [
            k
            for k in names
            if (part.rows[k].smooth or values[k] != part.nominal[k])
            and not part.rows[k].stepped
        ]
        if not which:
            break
        if slopes is None or any(k not in slopes for k in which):
            slopes = part.slopes(values, which, only=only)
        moved = _step(part, values, rest, which, known, slopes, only)
        slopes = None
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
    return np.where(problem.seen, problem.recorded - np.nan_to_num(made, nan=1e3), 0.0)


def _step(
    problem: Problem,
    values: np.ndarray,
    rest: np.ndarray,
    chosen: Sequence[int],
    known: Noise,
    slopes: Mapping[int, np.ndarray],
    only: list[int] | None,
) -> tuple[np.ndarray, np.ndarray] | None:
    """One damped step that lowers the loss; None if there is none."""
    which = np.array(chosen)
    weight = known.weights(rest, problem.seen).ravel()
    design = np.stack([known.innovations(slopes[k]).ravel() for k in which], axis=-1)
    design = design * problem.sd[which]
    # what was found by its level has a flat prior
    flat = np.array([1.0 if problem.rows[k].smooth else 0.2 for k in which])
    free = np.array([not problem.rows[k].nuisance for k in which])

    def departure(at: np.ndarray) -> np.ndarray:
        return flat * (at[which] - problem.nominal[which]) / problem.sd[which]

    def height(at: np.ndarray, left: np.ndarray) -> float:
        far = departure(at)
        prior = float((far**2).sum()) + 2 * tail(far[free])
        return known.loss(left) / known.lam + prior

    wider = np.where(free, np.maximum(np.abs(departure(values)), 1.0), 1.0)
    held = (flat / wider) ** 2  # by their priors, see `tail`
    heavy = design * weight[:, None]
    curvature = heavy.T @ design / known.lam + np.diag(held)
    pull = heavy.T @ known.innovations(np.nan_to_num(rest)).ravel() / known.lam
    pull -= held * departure(values) / flat
    now = height(values, rest)
    low, high = problem.bounds
    for damping in DAMPING:
        step = np.linalg.solve(curvature + damping * np.eye(len(which)), pull)
        step *= min(1.0, LONGEST / (np.abs(step).max() + 1e-30))
        there = values.copy()
        there[which] += step * problem.sd[which]
        there = np.clip(there, low, high)
        left = _rest(problem, there, only)
        if height(there, left) <= now + 1e-6:
            return there, left
    return None
