"""How far recorded and predicted motion part over several lengths of time."""

from collections.abc import Sequence

import numpy as np

from bns import seeding
from bns.gap.core.floor import coarser, derivative
from bns.gap.core.problem import Problem
from bns.gap.records import Residuals
from bns.worlds.effects.base import Effect

HORIZONS = (0.3, 1.0, 3.0, np.inf)  # [s]
DRAWS = 400


def residuals(
    problem: Problem, effects: Sequence[Effect] = (), *, seed: int = 0
) -> Residuals:
    """Residuals of relative motion by horizon and channel.

    Args:
        problem: the recording.
        effects: that the prediction includes.
        seed: of the bootstrap over trials.
    """
    squares = [by_trial(problem, effects, horizon) for horizon in HORIZONS]
    rng = seeding.generator(seed, "gap", "residuals")
    chosen = rng.integers(0, len(problem.trials), (DRAWS, len(problem.trials)))
    rms, low, high = [], [], []
    for square in squares:
        rms.append(np.sqrt(_mean(square, 0)))
        drawn = np.sqrt(_mean(square[chosen], 1))
        low.append(np.nanquantile(drawn, 0.05, axis=0))
        high.append(np.nanquantile(drawn, 0.95, axis=0))
    return Residuals(
        horizons=HORIZONS,
        rms=np.array(rms),
        low=np.array(low),
        high=np.array(high),
        channels=tuple(channel.name for channel in problem.model.features),
        units=tuple(channel.unit for channel in problem.model.features),
    )


def _mean(square: np.ndarray, axis: int) -> np.ndarray:
    """Mean of what is there; NaN where nothing is (trials shorter than a horizon)."""
    there = ~np.isnan(square)
    count, total = there.sum(axis), np.where(there, square, 0.0).sum(axis)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def by_trial(problem: Problem, effects: Sequence[Effect], horizon: float) -> np.ndarray:
    """Mean squared residual of each trial over windows of a length, ``(N, C)``.

    Args:
        problem: the recording.
        effects: added to the nominal model.
        horizon: length of the windows [s].

    Returns:
        by trial and feature, in the feature's unit squared; NaN where a trial has no
        window of that length.
    """
    (predicted,) = problem.model.simulate(problem.trials, [tuple(effects)])
    rows = []
    for trial, made, windows in zip(
        problem.trials, predicted, problem.windows, strict=True
    ):
        longer = coarser(windows, horizon)
        if not len(longer):
            rows.append(np.full(len(problem.model.features), np.nan))
            continue
        gap = problem.model.compare(trial, trial.observed, longer)
        gap = gap - problem.model.compare(trial, made, longer)
        rows.append((gap**2).mean(axis=0))
    return np.array(rows)


def noise(problem: Problem, horizon: float) -> np.ndarray:
    """Mean square that the floor alone gives over windows of a length, ``(C,)``."""
    trial, windows = problem.trials[0], problem.windows[0]
    longer = coarser(windows, horizon)
    if not len(longer):
        return np.full(len(problem.model.features), np.nan)
    jacobian = derivative(problem.model, trial, longer) * problem.floor.sigma
    measured = (jacobian**2).sum(axis=(1, 2)).reshape(len(longer), -1)
    scattered = np.outer(longer.durations, problem.floor.process**2)
    return (measured + scattered).mean(axis=0)
