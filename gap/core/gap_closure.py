"""How far the gap closes: before, after each effect, the floor and a ceiling."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bns import seeding
from bns.gap.core import residuals, select
from bns.gap.core.fit import Point
from bns.gap.core.null import Null
from bns.gap.core.problem import Problem
from bns.gap.core.select import Search
from bns.gap.core.whitening import loss
from bns.gap.models.base import GapModel
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

HORIZON = 1.0  # [s] over which gaps are given in plain units
DRAWS = 1000
CLEAN = 0.01  # p-value above which a rest has no structure
RIDGE = 8.0  # of the flexible model's weights, in whitened units


def quantify(
    problem: Problem, null: Null, search: Search, best: Point, *, seed: int = 0
) -> dict[str, Any]:
    """The gap on trials that were not fitted, and the share that is closed.

    Energies are whitened losses per residual, held out. The floor is what the best
    model reaches if its rest has no structure left, else 1, which is what the noise
    was estimated to give.

    Args:
        problem: the recording.
        null: its null distributions and flexible directions.
        search: supports that were fitted, by size.
        best: the chosen support.
        seed: of the bootstrap.

    Returns:
        before, after, floor, ceiling: energies; singles: after each effect alone;
        closed: (before - after) / (before - floor) with a 90 % bootstrap interval
        over trials; plain: root mean square over a second, before and after.
    """
    count = np.array([rows.stop - rows.start for rows in problem.whiten.rows])
    before = select.held_out(problem, search.nothing)[1]
    after = select.held_out(problem, best)[1]
    ceiling = flexible(problem, null)
    reached = [float(after.sum() / count.sum()), float(ceiling.sum() / count.sum())]
    clean = null.misfit(problem, best.rest)[0] > CLEAN
    lowest = min(reached) if clean else min(1.0, *reached)
    floor = lowest * count
    singles = {
        point.names[0]: select.held_out(problem, point)[0] / count.sum()
        for point in search.sizes[0]
    }
    rng = seeding.generator(seed, "gap", "closed")
    drawn = rng.integers(0, len(count), (DRAWS, len(count)))
    shares = _share(before[drawn].sum(1), after[drawn].sum(1), floor[drawn].sum(1))
    effects = [term.effect() for term in best.terms]
    return {
        "before": before.sum() / count.sum(),
        "after": after.sum() / count.sum(),
        "floor": lowest,
        "ceiling": ceiling.sum() / count.sum(),
        "singles": singles,
        "closed": float(_share(before.sum(), after.sum(), floor.sum())),
        "closed_interval": np.quantile(shares, [0.05, 0.95]).tolist(),
        "closed_by_flexible": float(_share(before.sum(), ceiling.sum(), floor.sum())),
        "plain": plain_gap(problem, effects),
    }


def _share(before, after, floor):
    whole = np.maximum(before - floor, 1e-12)
    return np.clip((before - after) / whole, -1.0, 1.0)


def plain_gap(problem: Problem, effects: Sequence[Effect]) -> dict[str, Any]:
    """Root mean square over `HORIZON` by channel: before, after, floor."""

    def rms(chosen: Sequence[Effect]) -> list[float]:
        squares = residuals.by_trial(problem, chosen, HORIZON)
        return np.sqrt(np.nanmean(squares, axis=0)).tolist()

    return {
        "horizon": HORIZON,
        "channels": [f"{c.name} [{c.unit}]" for c in problem.model.features],
        "before": rms(()),
        "after": rms(effects),
        "floor": np.sqrt(residuals.noise(problem, HORIZON)).tolist(),
    }


def flexible(
    problem: Problem, null: Null, rest: np.ndarray | None = None, *, folds: int = 5
) -> np.ndarray:
    """Held-out loss by trial of a flexible model of the gap: what is predictable.

    Args:
        problem: the recording.
        null: its flexible directions.
        rest: what is predicted; None = all that the nominal model leaves.
        folds: groups of trials.

    Returns:
        summed loss of each trial, ``(n_trials,)``.
    """
    rest, rows = problem.rest if rest is None else rest, problem.whiten.rows
    made = np.zeros(len(rows))
    for group in [range(k, len(rows), folds) for k in range(min(folds, len(rows)))]:
        kept = np.ones(len(rest), dtype=bool)
        for number in group:
            kept[rows[number]] = False
        basis = null.basis[kept]
        normal = basis.T @ basis + np.eye(basis.shape[1]) / RIDGE**2
        weights = np.linalg.solve(normal, basis.T @ rest[kept])
        for number in group:
            made[number] = loss(rest[rows[number]] - null.basis[rows[number]] @ weights)
    return made


def edit_error(
    trials: Sequence[Trial],
    model: GapModel,
    effects: Sequence[Effect],
    removed: str,
) -> dict[str, float]:
    """The edit test: take an effect away and predict another recording.

    Args:
        trials: a recording in which the effect was not there.
        model: nominal model.
        effects: the corrected model's.
        removed: name of the effect to take away.

    Returns:
        whitened error per residual with the effect removed (`edited`), left in
        (`kept`), and of the nominal model (`nominal`).
    """
    problem = Problem.of(trials, model)
    left = tuple(effect for effect in effects if effect.name != removed)
    rests = problem.rests([left, tuple(effects), ()])
    edited, kept, nominal = (float(loss(rest)) / len(rest) for rest in rests)
    return {"edited": edited, "kept": kept, "nominal": nominal}
