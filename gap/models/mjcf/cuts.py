"""One long recording as trials of a few seconds, each begun in the state it was in.

The state is taken from the data: a parabola through the samples around the start gives
each observed joint's position and speed, which the model's own motion makes exact. What
was told in the second before goes along, so that what comes late has something before
it.
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from bns.gap.models.base import GapModel
from bns.gap.models.mjcf import start
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.recordings.stretches import piece
from bns.worlds.trial import Trial

HALF = 0.03  # [s] on each side of a start, of the samples that tell its state
LEAST = 4  # samples on each side at least
BEFORE = 0.5  # [s] of commands before a piece
GRID = 0.005  # [s] between them
REFINED = 2  # times that starts are fitted to the nominal motion


def pieces(trial: Trial, config: OwnConfig) -> list[Trial]:
    """A trial in pieces of about `config.cut` seconds; itself if it is not longer. The
    first begins as the trial did.

    Args:
        trial: recorded; each change of its commands is a command.
        config: of the robot; joints among its channels get a state.
    """
    span = float(trial.times[-1] - trial.times[0])
    count = round(span / config.cut)
    if count < 2:
        return [_begun(trial, trial, 0, config) if config.recorded else trial]
    seen = np.flatnonzero(np.isfinite(trial.observed).all(axis=1))
    wanted = trial.times[0] + np.arange(count + 1) * span / count
    rows = seen[np.clip(np.searchsorted(trial.times[seen], wanted), 0, len(seen) - 1)]
    rows = np.unique(np.append(rows[:-1], len(trial.times) - 1))
    made = [piece(trial, first, last) for first, last in pairwise(rows)]
    return [
        _begun(part, trial, first, config) if first or config.recorded else part
        for part, first in zip(made, rows[:-1], strict=True)
    ]


def refined(trials: Sequence[Trial], config: OwnConfig, model: GapModel) -> list[Trial]:
    """Trials whose starts are those from which the nominal model comes nearest to what
    was seen of the joints, within what the data leave open.

    A joint that is thrown follows no parabola. What an effect changes in these ways
    counts for nothing anyway: it may be the start's.

    Args:
        trials: pieces, with a state and how unsure it is; where none is unsure they
            stay as they are.
        config: of the robot.
        model: the nominal model.
    """
    joints = [k for k, item in enumerate(config.seen) if item.quantity == "joint"]
    made, noise = list(trials), np.array([config.seen[k].noise for k in joints])
    for _ in range(REFINED):
        names, (base, *ways) = model.started(made, [{} for _ in made])
        if not names:
            return made
        for number, (trial, known) in enumerate(zip(made, base, strict=True)):
            change = np.stack([way[number] - known for way in ways])[..., joints]
            units = (trial.observed - known)[:, joints] / noise
            size = _nearest(units, change / noise)
            sds = start.unsure(trial, config)
            found = zip(names, size, strict=True)
            off = {n: float(z) * sds[n] for n, z in found if n in sds}
            made[number] = start.moved(trial, off, config) if off else trial
    return made


def _nearest(units: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Departures of the numbers of a start, in their standard deviations ``(K,)``.

    Args:
        units: residuals of the joints over their noise, ``(T, J)``.
        change: what one standard deviation of each number makes of them, ``(K, T, J)``.
    """
    seen = np.isfinite(units) & np.isfinite(change).all(axis=0)
    design = change[:, seen].T
    curvature = design.T @ design + np.eye(len(change))
    return np.linalg.solve(curvature, design.T @ units[seen])


def _begun(part: Trial, whole: Trial, first: int, config: OwnConfig) -> Trial:
    found = state(whole, first, config)
    known = {joint: numbers[:2] for joint, numbers in found.items()}
    unsure = {joint: numbers[2:] for joint, numbers in found.items()}
    conditions = {**part.conditions, start.STATE: known, start.UNSURE: unsure}
    past = commands_before(whole, first)
    if past:
        conditions |= {start.BEFORE: past, start.STEP: GRID}
    return part.replace(conditions=conditions)


def commands_before(trial: Trial, row: int) -> list[list[float]]:
    """What was told in the last `BEFORE` seconds before a sample, every `GRID`."""
    begin = trial.times[row]
    past = min(BEFORE, begin - trial.times[0])
    moments = begin - np.arange(int(past / GRID + 1e-9), 0, -1) * GRID
    at = np.searchsorted(trial.times[trial.boundaries], moments + 1e-9, side="right")
    rows = np.clip(at - 1, 0, len(trial.commands) - 1)
    return trial.commands.values[rows].tolist()


def state(trial: Trial, row: int, config: OwnConfig) -> dict[str, list[float]]:
    """Position and speed of each observed joint at a sample, and how sure these are.

    A speed that is observed itself is taken as the mean around the sample.

    Args:
        trial: the recording.
        row: index of the sample.
        config: which joint each column observes.

    Returns:
        position [rad or m], speed, per second, and the standard deviations of both, by
        joint.
    """
    found: dict[str, list[float]] = {}
    near = around(trial.times, np.isfinite(trial.observed).all(axis=1), row)
    at = trial.times[near] - trial.times[row]
    for column, item in enumerate(config.seen):
        if item.quantity == "joint":
            found[item.part] = parabola(at, trial.observed[near, column], item.noise)
    for column, item in enumerate(config.seen):
        if item.quantity == "speed":
            mean, _, sd, _ = parabola(at, trial.observed[near, column], item.noise)
            if item.part in found:
                found[item.part][1::2] = mean, sd
    return found


def around(times: np.ndarray, seen: np.ndarray, row: int) -> np.ndarray:
    """Samples near a row: within `HALF` of it, `LEAST` on each side where there are.

    Args:
        times: of the samples [s], ``(T,)``.
        seen: whether each was seen, ``(T,)``.
        row: index of the sample in the middle.

    Returns:
        indices of samples that were seen.
    """
    rows = np.flatnonzero(seen)
    place = int(np.searchsorted(rows, row))
    inside = np.abs(times[rows] - times[row]) <= HALF
    inside[max(place - LEAST, 0) : place + LEAST + 1] = True
    return rows[inside]


def parabola(at: np.ndarray, values: np.ndarray, noise: float) -> list[float]:
    """Value and slope at 0 of the parabola nearest to samples (a line through few).

    Args:
        at: times of the samples [s], ``(n,)``.
        values: of them, ``(n,)``.
        noise: standard deviation of a sample. Where the samples lie farther from the
            parabola than that, it is as unsure as they say.

    Returns:
        value; slope, per second; standard deviations of both.
    """
    degree = min(2, len(at) - 1)
    if degree < 1:
        return [float(values[0]), 0.0, noise, 0.0]
    basis = np.vander(at, degree + 1, increasing=True)
    found = np.linalg.lstsq(basis, np.asarray(values, float), rcond=None)[0]
    free = len(at) - degree - 1
    left = np.sum((values - basis @ found) ** 2) / free if free else 0.0
    sd = np.sqrt(np.diag(np.linalg.inv(basis.T @ basis)) * max(noise**2, left))
    return [float(number) for number in (found[0], found[1], sd[0], sd[1])]
