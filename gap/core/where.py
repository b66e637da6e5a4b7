"""Where the gap sits: channel, wheel, horizon, sensor or motion, time, regime."""

from typing import Any

import numpy as np
from scipy.stats import chi2

from bns import seeding
from bns.gap.core import floor, residuals, tree
from bns.gap.core.fit import Point
from bns.gap.core.problem import Problem
from bns.gap.core.whitening import terms
from bns.gap.recordings import trial_labels

DRAWS = 400
TRACK = 0.045  # [m] half the track: a turn as travel of the wheels
FLAT, GROWING = 0.35, 0.7  # growth of the error with the horizon: sensor; motion
CHANGE = 1e-3  # p-value below which a change in time is reported
BANDS = (0.3, 2.0)  # [Hz] where the phase is taken


def where(problem: Problem, best: Point, *, seed: int = 0) -> dict[str, Any]:
    """All of it, as plain data.

    Args:
        problem: the recording.
        best: chosen support (its rest shows what is left; unused if empty).
        seed: of the bootstraps.
    """
    found = residuals.residuals(problem, seed=seed)
    scatter = np.array([residuals.noise(problem, h) for h in found.horizons])
    return {
        "horizons": list(found.horizons),
        "channels": list(found.channels),
        "units": list(found.units),
        "rms": found.rms.tolist(),
        "rms_low": found.low.tolist(),
        "rms_high": found.high.tolist(),
        "rms_floor": np.sqrt(scatter).tolist(),
        "shares": shares(problem, seed=seed),
        "wheels": wheels(problem, seed=seed),
        "nature": nature(problem),
        "change": change_point(problem),
        "regime": tree.regime(problem, seed=seed),
        "phase": phase(problem),
        "left_over": float(terms(best.rest).mean()),
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


def shares(problem: Problem, *, seed: int = 0) -> dict[str, Any]:
    """Share of the whitened energy beyond the floor by feature channel."""
    channels = [channel.name for channel in problem.model.features]
    energy = terms(problem.rest) - 1
    values = np.array(
        [
            energy[rows].reshape(-1, len(channels)).sum(axis=0)
            for rows in problem.whiten.rows
        ]
    )
    share, low, high = _intervals(values, seed, "shares")
    return {"channels": channels, "share": share, "low": low, "high": high}


def wheels(problem: Problem, *, seed: int = 0) -> dict[str, Any]:
    """Share of the excess motion over a second by wheel; empty for other models."""
    names = [channel.name for channel in problem.model.features]
    if names != ["forward", "left", "turn"]:
        return {}
    (predicted,) = problem.model.simulate(problem.trials, [()])
    rows = []
    for trial, made, windows in zip(
        problem.trials, predicted, problem.windows, strict=True
    ):
        longer = floor.coarser(windows, 1.0)
        gap = problem.model.compare(trial, trial.observed, longer)
        gap = gap - problem.model.compare(trial, made, longer)
        travel = gap[:, :1] + TRACK * gap[:, 2:] * np.array([[-1.0, 1.0]])
        rows.append((travel**2).sum(axis=0))
    share, low, high = _intervals(np.array(rows), seed, "wheels")
    return {"wheels": ["left", "right"], "share": share, "low": low, "high": high}


def nature(problem: Problem) -> dict[str, Any]:
    """Sensor or motion: does the error grow with the time since a state was observed?

    Returns:
        growth: exponent of the error with the horizon, floor taken off (0 = the same
        at every horizon: a sensor; 1 = in proportion: motion); and the verdict.
    """
    horizons = [0.3, 1.0, 3.0]
    excess = []
    for horizon in horizons:
        square = np.nanmean(residuals.by_trial(problem, (), horizon), axis=0)
        floor = residuals.noise(problem, horizon)
        excess.append(np.maximum(square - floor, 0) / floor)
        excess[-1] = float((excess[-1] * floor / residuals.noise(problem, 1.0)).sum())
    values = np.sqrt(np.maximum(excess, 1e-12))
    if values.max() < 0.1:
        return {"growth": 0.0, "verdict": "too small to say"}
    growth = float(np.polyfit(np.log(horizons), np.log(values + 1e-6), 1)[0])
    named = "sensor or timing" if growth < FLAT else "motion"
    named = named if growth < FLAT or growth > GROWING else "motion or timing"
    return {"growth": growth, "verdict": named}


def change_point(problem: Problem) -> dict[str, Any]:
    """The moment at which the gap sets in or ends, if there is one.

    The energy of the rest is compared before and after every window, over all trials
    in the order of their numbers, so that runs that had the same damage at the same
    trial say it together; the largest contrast counts, corrected for having looked
    everywhere.
    """
    channels = len(problem.model.features)
    numbers = trial_labels.numbers(problem.trials)
    energy, stamps = [], []
    for place in sorted(range(len(numbers)), key=numbers.__getitem__):
        rows = problem.whiten.rows[place]
        piece = terms(problem.rest[rows]).reshape(-1, channels).sum(axis=1)
        energy.append(np.minimum(piece, 8.0 * channels))
        times = problem.windows[place].times
        stamps += [(numbers[place], float(time)) for time in times]
    series = np.concatenate(energy)
    count = len(series)
    if count < 40:
        return {}
    at = np.arange(10, count - 10)
    total = np.cumsum(series)
    left, right = total[at - 1] / at, (total[-1] - total[at - 1]) / (count - at)
    # neighbouring windows share noise: their energies count as half independent
    spread = series.std() * np.sqrt(2.0) * np.sqrt(1 / at + 1 / (count - at))
    score = np.abs(right - left) / np.maximum(spread, 1e-12)
    best = int(score.argmax())
    p = min(1.0, float(chi2.sf(score[best] ** 2, 1)) * np.log(count) * 4)
    jump = max(left[best], right[best]) / max(min(left[best], right[best]), 1e-12)
    if p > CHANGE or jump < 1.5:
        return {"p": p}
    trial, time = stamps[at[best]]
    direction = "sets in" if right[best] > left[best] else "ends"
    place = sum(number < trial for number in set(numbers))
    return {
        "p": p, "trial": trial, "time": time, "direction": direction, "place": place,
    }  # fmt: skip


def phase(problem: Problem) -> dict[str, Any]:
    """Delay of recorded behind predicted motion from the slope of the phase.

    Returns:
        delay [s] by channel of features, and its coherence (0..1).
    """
    names = [channel.name for channel in problem.model.features]
    made: dict[str, Any] = {}
    for column, name in enumerate(names):
        cross, power = {}, {}
        for seen, told, windows in zip(
            problem.recorded, problem.nominal, problem.windows, strict=True
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
