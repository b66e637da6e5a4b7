"""Where the gap sits: channel, wheel, horizon, sensor or motion, regime."""

from collections.abc import Sequence
from typing import Any

import numpy as np

from bns import seeding
from bns.gap.where import horizons, regimes
from bns.gap.where.compared import Compared, coarser, terms
from bns.worlds.effects.base import Effect

DRAWS = 400
TRACK = 0.045  # [m] half the track: a turn as travel of the wheels
FLAT, GROWING = 0.35, 0.7  # growth of the error with the horizon: sensor; motion
TOO_SMALL, TOO_SHORT = "too small to say", "too short to say"
GROWN = (0.3, 1.0, 3.0)  # [s] horizons over which an error may grow
BANDS = (0.3, 2.0)  # [Hz] where the phase is taken


def where(
    compared: Compared, effects: Sequence[Effect], *, seed: int = 0
) -> dict[str, Any]:
    """All of it, as plain data.

    Args:
        compared: the recording.
        effects: of the corrected model, for what it leaves.
        seed: of the bootstraps.
    """
    found = horizons.residuals(compared, seed=seed)
    scatter = np.array([horizons.noise(compared, h) for h in found.horizons])
    left = np.concatenate([terms(part).ravel() for part in compared.left(effects)])
    return {
        "horizons": list(found.horizons),
        "channels": list(found.channels),
        "units": list(found.units),
        "rms": found.rms.tolist(),
        "rms_low": found.low.tolist(),
        "rms_high": found.high.tolist(),
        "rms_floor": np.sqrt(scatter).tolist(),
        "shares": shares(compared, seed=seed),
        "wheels": wheels(compared, seed=seed),
        "nature": nature(compared),
        "change": {},
        "regime": regimes.regime(compared, seed=seed),
        "phase": phase(compared),
        "left_over": float(left.mean()),
    }


def _intervals(values: np.ndarray, seed: int, name: str) -> tuple[list, list, list]:
    """Shares of columns in a sum over trials, with 90 % bootstrap intervals."""
    rng = seeding.generator(seed, "gap", name)
    drawn = rng.integers(0, len(values), (DRAWS, len(values)))
    sums = np.maximum(values[drawn].sum(axis=1), 0) + 1e-12
    part = sums / sums.sum(axis=1, keepdims=True)
    whole = np.maximum(values.sum(axis=0), 0) + 1e-12
    low, high = np.quantile(part, [0.05, 0.95], axis=0)
    return (whole / whole.sum()).tolist(), low.tolist(), high.tolist()


def shares(compared: Compared, *, seed: int = 0) -> dict[str, Any]:
    """Share of the energy beyond the scatter by feature channel."""
    channels = [channel.name for channel in compared.model.features]
    values = np.array([(terms(gap) - 1).sum(axis=0) for gap in compared.gap])
    share, low, high = _intervals(values, seed, "shares")
    return {"channels": channels, "share": share, "low": low, "high": high}


def wheels(compared: Compared, *, seed: int = 0) -> dict[str, Any]:
    """Share of the excess motion over a second by wheel; empty for other models."""
    names = [channel.name for channel in compared.model.features]
    if names != ["forward", "left", "turn"]:
        return {}
    (predicted,) = compared.model.simulate(compared.trials, [()])
    rows = []
    for trial, made, windows in zip(
        compared.trials, predicted, compared.windows, strict=True
    ):
        longer = coarser(windows, 1.0)
        gap = compared.model.compare(trial, trial.observed, longer)
        gap = gap - compared.model.compare(trial, made, longer)
        travel = gap[:, :1] + TRACK * gap[:, 2:] * np.array([[-1.0, 1.0]])
        rows.append((travel**2).sum(axis=0))
    share, low, high = _intervals(np.array(rows), seed, "wheels")
    return {"wheels": ["left", "right"], "share": share, "low": low, "high": high}


def nature(compared: Compared) -> dict[str, Any]:
    """Sensor or motion: does the error grow with the time since a state was observed?

    Returns:
        growth: exponent of the error with the horizon, floor taken off (0 = the same
        at every horizon: a sensor; 1 = in proportion: motion); and the verdict.
    """
    excess: list[float] = []
    unit = horizons.noise(compared, 1.0)
    unit = unit if np.isfinite(unit).all() else horizons.noise(compared, GROWN[0])
    for horizon in GROWN:
        square = horizons.mean(horizons.by_trial(compared, (), horizon), 0)
        floor = horizons.noise(compared, horizon)
        if not np.isfinite(square + floor).all():
            break  # no trial is that long
        excess.append(float((np.maximum(square - floor, 0) / unit).sum()))
    values = np.sqrt(np.maximum(excess, 1e-12))
    if values.max(initial=0.0) < 0.1:
        return {"growth": 0.0, "verdict": TOO_SMALL}
    if len(values) < 2:
        return {"growth": 0.0, "verdict": TOO_SHORT}
    spans = np.log(GROWN[: len(values)])
    growth = float(np.polyfit(spans, np.log(values + 1e-6), 1)[0])
    named = "sensor or timing" if growth < FLAT else "motion"
    named = named if growth < FLAT or growth > GROWING else "motion or timing"
    return {"growth": growth, "verdict": named}


def phase(compared: Compared) -> dict[str, Any]:
    """Delay of recorded behind predicted motion from the slope of the phase.

    Returns:
        delay [s] by channel of features, and its coherence (0..1).
    """
    names = [channel.name for channel in compared.model.features]
    made: dict[str, Any] = {}
    for column, name in enumerate(names):
        cross: dict[float, np.ndarray] = {}
        power: dict[float, np.ndarray] = {}
        for seen, told, windows in zip(
            compared.recorded, compared.nominal, compared.windows, strict=True
        ):
            step = float(np.median(windows.durations))
            grid = np.arange(windows.times[0], windows.times[-1], step)
            a = np.interp(grid, windows.times, seen[:, column] / windows.durations)
            b = np.interp(grid, windows.times, told[:, column] / windows.durations)
            taper = np.hanning(len(grid))
            fa, fb = (np.fft.rfft((v - v.mean()) * taper, 256) for v in (a, b))
            key = round(step, 3)
            cross[key] = cross.get(key, 0) + fa * np.conj(fb)
            power[key] = power.get(key, 0) + np.array([abs(fa) ** 2, abs(fb) ** 2])
        key = max(cross, key=lambda k: np.abs(cross[k]).sum())
        hertz = np.fft.rfftfreq(256, key)
        band = (hertz > BANDS[0]) & (hertz < min(BANDS[1], 0.4 / key))
        weight, angle = np.abs(cross[key][band]), np.angle(cross[key][band])
        omega = 2 * np.pi * hertz[band]
        norm = (weight * omega**2).sum()
        if norm > 0:
            delay = float(-(weight * omega * angle).sum() / norm)
            both = np.sqrt(power[key][0][band] * power[key][1][band]).sum()
            made[name] = {"delay": delay, "coherence": float(weight.sum() / both)}
    return made
