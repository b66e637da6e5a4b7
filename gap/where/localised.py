"""Where the gap sits: channel, wheel, horizon, sensor or motion, regime.

The regime is told by a small regression tree, pruned on held-out trials.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any

import numpy as np

from bns import seeding
from bns.gap.where import horizons
from bns.gap.where.compared import Compared, coarser, terms
from bns.worlds.effects.base import Effect

DEPTH, CUTS = 2, 12  # splits in a row; thresholds tried per quantity
LEAST = 0.08  # share of windows in a leaf
GAIN = 0.05  # share of the held-out variance that the tree has to explain
CAP = 9.0  # mean energy of a window beyond which more does not count


@dataclass(frozen=True)
class Node:
    """A leaf, or a split at a threshold of one quantity."""

    mean: float
    share: float
    name: str = ""
    cut: float = 0.0
    below: "Node | None" = None
    above: "Node | None" = None


def regime(compared: Compared, *, seed: int = 0) -> dict[str, Any]:
    """The regime in words, empty if the gap is alike everywhere.

    Returns:
        words: where most of it sits; energy: mean whitened energy there and
        elsewhere; explained: held-out share of the variance.
    """
    columns: dict[str, list] = {}
    energy, owner = [], []
    for number, (trial, windows, gap) in enumerate(
        zip(compared.trials, compared.windows, compared.gap, strict=True)
    ):
        for name, value in compared.model.regime(trial, windows).items():
            columns.setdefault(name, []).append(value)
        energy.append(np.minimum(terms(gap).mean(axis=1), CAP))
        owner.append(np.full(len(windows), number))
    table = {name: np.concatenate(value) for name, value in columns.items()}
    if not table:
        return {}
    target, owners = np.concatenate(energy), np.concatenate(owner)
    held_out = owners % 3 == seed % 3
    if held_out.all() or not held_out.any():
        return {}
    tree = grow({k: v[~held_out] for k, v in table.items()}, target[~held_out], DEPTH)
    test = {name: value[held_out] for name, value in table.items()}
    truth = target[held_out]
    explained = 1 - ((truth - predict(tree, test)) ** 2).mean() / max(
        truth.var(), 1e-12
    )
    if explained < GAIN or not tree.name:
        return {"explained": float(explained)}
    words, mean = worst(tree)
    rest = (target.mean() - mean[0] * mean[1]) / max(1 - mean[1], 1e-9)
    return {
        "words": " and ".join(words),
        "energy": [float(mean[0]), float(max(rest, 0.0))],
        "share": float(mean[1]),
        "explained": float(explained),
    }


def grow(
    table: Mapping[str, np.ndarray], target: np.ndarray, depth: int, share: float = 1.0
) -> Node:
    """The tree that lowers the squared error most at every split.

    Args:
        table: what may split, by name, each ``(W,)``.
        target: what is explained, ``(W,)``.
        depth: number of splits that may follow one another.
        share: of all windows that these are; 1 at the root.
    """
    leaf = Node(float(target.mean()), share)
    least = max(int(LEAST * len(target) / share), 10)
    if depth == 0 or len(target) < 2 * least:
        return leaf
    best = (0.0, "", 0.0)
    for name, value in table.items():
        cuts = np.unique(np.quantile(value, np.linspace(0.05, 0.95, CUTS)))
        if value.min() < 0 < value.max():
            cuts = np.append(cuts, 0.0)
        for cut in cuts:
            above = value > cut
            count = int(above.sum())
            if min(count, len(value) - count) < least:
                continue
            apart = target[above].mean() - target[~above].mean()
            gain = apart**2 * count * (len(value) - count) / len(value)
            if gain > best[0]:
                best = (gain, name, float(cut))
    if not best[1]:
        return leaf
    _, name, cut = best
    sides = []
    for chosen in (table[name] <= cut, table[name] > cut):
        part = {key: value[chosen] for key, value in table.items()}
        sides.append(grow(part, target[chosen], depth - 1, share * chosen.mean()))
    return Node(leaf.mean, share, name, cut, *sides)


def predict(tree: Node, table: Mapping[str, np.ndarray]) -> np.ndarray:
    """Mean of the leaf that each window falls into, ``(W,)``."""
    width = len(next(iter(table.values())))
    if tree.below is None or tree.above is None:
        return np.full(width, tree.mean)
    above = table[tree.name] > tree.cut
    return np.where(above, predict(tree.above, table), predict(tree.below, table))


def worst(tree: Node) -> tuple[list[str], Sequence[float]]:
    """The leaf with the largest mean: conditions in words, (mean, share)."""
    if tree.below is None or tree.above is None:
        return [], (tree.mean, tree.share)
    options = []
    for node, side in ((tree.below, "at most"), (tree.above, "above")):
        words, found = worst(node)
        options.append((found[0], [_words(tree.name, side, tree.cut), *words], found))
    _, words, found = max(options, key=lambda option: option[0])
    return words, found


def _words(name: str, side: str, cut: float) -> str:
    name, _, unit = name.partition(" [")
    if abs(cut) < 1e-9:
        return f"{name} is {'negative or zero' if side == 'at most' else 'positive'}"
    return f"{name} is {side} {cut:.3g} {unit.rstrip(']')}".rstrip()


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
        "regime": regime(compared, seed=seed),
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
