"""How far recorded and predicted motion part over several lengths of time."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bns import seeding
from bns.gap.records import Residuals
from bns.gap.where.compared import Compared, coarser
from bns.worlds.effects.base import Effect

HORIZONS = (0.3, 1.0, 3.0, np.inf)  # [s]
PLAIN = 1.0  # [s] over which gaps are given in plain units
DRAWS = 400


def residuals(
    compared: Compared, effects: Sequence[Effect] = (), *, seed: int = 0
) -> Residuals:
    """Residuals of relative motion by horizon and channel.

    Args:
        compared: the recording.
        effects: that the prediction includes.
        seed: of the bootstrap over trials.
    """
    squares = [by_trial(compared, effects, horizon) for horizon in HORIZONS]
    rng = seeding.generator(seed, "gap", "residuals")
    chosen = rng.integers(0, len(compared.trials), (DRAWS, len(compared.trials)))
    rms: list[np.ndarray] = []
    low: list[np.ndarray] = []
    high: list[np.ndarray] = []
    for square in squares:
        rms.append(np.sqrt(mean(square, 0)))
        drawn = np.sqrt(mean(square[chosen], 1))
        some = drawn[np.isfinite(drawn).all(axis=1)]
        for edge, share in ((low, 0.05), (high, 0.95)):
            edge.append(np.quantile(some, share, axis=0) if len(some) else 0 * rms[-1])
    return Residuals(
        horizons=HORIZONS,
        rms=np.array(rms),
        low=np.array(low),
        high=np.array(high),
        channels=tuple(channel.name for channel in compared.model.features),
        units=tuple(channel.unit for channel in compared.model.features),
    )


def mean(square: np.ndarray, axis: int) -> np.ndarray:
    """Mean of what is there; NaN where nothing is (trials shorter than a horizon)."""
    there = ~np.isnan(square)
    count, total = there.sum(axis), np.where(there, square, 0.0).sum(axis)
    return np.divide(total, count, out=np.full(total.shape, np.nan), where=count > 0)


def by_trial(
    compared: Compared, effects: Sequence[Effect], horizon: float
) -> np.ndarray:
    """Mean squared residual of each trial over windows of a length, ``(N, C)``.

    Args:
        compared: the recording.
        effects: added to the nominal model.
        horizon: length of the windows [s].

    Returns:
        by trial and feature, in the feature's unit squared; NaN where a trial has no
        window of that length.
    """
    model = compared.model
    (predicted,) = model.simulate(compared.trials, [tuple(effects)])
    rows = []
    for trial, made, windows in zip(
        compared.trials, predicted, compared.windows, strict=True
    ):
        longer = coarser(windows, horizon)
        if not len(longer):
            rows.append(np.full(len(model.features), np.nan))
            continue
        gap = model.compare(trial, trial.observed, longer)
        gap = gap - model.compare(trial, made, longer)
        rows.append((gap**2).mean(axis=0))
    return np.array(rows)


def noise(compared: Compared, horizon: float) -> np.ndarray:
    """Mean square that scatter alone gives over windows of a length, ``(C,)``."""
    longer = coarser(compared.windows[0], horizon)
    if not len(longer):
        return np.full(len(compared.model.features), np.nan)
    return compared.noise(0, longer).mean(axis=0)


def plain_gap(compared: Compared, effects: Sequence[Effect]) -> dict[str, Any]:
    """Root mean square over `PLAIN` by channel: before, after, floor.

    Args:
        compared: the recording.
        effects: of the corrected model.
    """

    def rms(chosen: Sequence[Effect]) -> list[float]:
        squares = by_trial(compared, chosen, PLAIN)
        return np.sqrt(mean(squares, 0)).tolist()

    return {
        "horizon": PLAIN,
        "channels": [f"{c.name} [{c.unit}]" for c in compared.model.features],
        "before": rms(()),
        "after": rms(effects),
        "floor": np.sqrt(noise(compared, PLAIN)).tolist(),
    }
