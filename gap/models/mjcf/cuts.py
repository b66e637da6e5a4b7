"""One long recording as trials of a few seconds, each begun in the state it was in.

The state is taken from the data: a parabola through the samples around the start gives
each observed joint's position and speed, which the model's own motion makes exact. What
was told in the second before goes along, so that what comes late has something before
it.

Trials of robots that are unstable under the commands alone are cut to the length that
their model foresees (`foreseen`). A pole that starts upright falls to the side to which
the start was off. Compared all along, it would say nothing but that; compared over
pieces that begin in the states of the data, it is a robot like others.
"""

from collections.abc import Callable, Iterator, Mapping, Sequence
from dataclasses import replace
from itertools import pairwise
from types import MappingProxyType

import mujoco
import numpy as np

from bns.gap.models.base import GapModel
from bns.gap.models.mjcf import prepared, start
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.simulation import Simulation
from bns.gap.recordings.segments import piece
from bns.worlds.data.units import wrapped
from bns.worlds.trial import Trial

HALF = 0.03  # [s] on each side of a start, of the samples that tell its state
LEAST = 4  # samples on each side at least
BEFORE = 0.5  # [s] of commands before a piece
GRID = 0.001  # [s] between them
REFINED = 2  # times that starts are fitted to the nominal motion, which may be wrong
RESTARTED = 6  # the same, at most, to the motion that was found
STILL = 0.1  # standard deviations of a start: it stays
BENT = 0.1  # deviations of the noise by which a motion may be out of proportion


Unseen = Callable[[Trial, Sequence[int]], list[dict[str, list[float]]]]
"""what joints that nobody observed do at samples of a trial (`Simulation.unseen`)"""


def pieces(
    trial: Trial, config: OwnConfig, unseen: Unseen | None = None
) -> list[Trial]:
    """A trial in pieces of about `config.cut` seconds; itself if it is not longer. The
    first begins as the trial did.

    Args:
        trial: recorded; each change of its commands is a command.
        config: of the robot; joints among its channels get a state.
        unseen: what the other joints do; None = they begin in the model's pose.
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
    beside: list[Mapping[str, list[float]]] = [{}] * len(made)
    if unseen:
        whole = _begun(trial, trial, 0, config) if config.recorded else trial
        beside[1:] = unseen(whole, rows[1:-1].tolist())
    return [
        _begun(part, trial, first, config, more) if first or config.recorded else part
        for part, first, more in zip(made, rows[:-1], beside, strict=True)
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
    return _refined(trials, config, model, [{} for _ in trials], REFINED)[0]


def restarted(
    trials: Sequence[Trial],
    config: OwnConfig,
    model: GapModel,
    known: Sequence[Mapping[str, float]],
) -> list[Trial]:
    """Trials whose starts are those from which explanations come nearest to what was
    seen; as they are, where the motion changes in proportion to its start.

    From a start that makes up for what the nominal model lacks, the motion that lacks
    nothing goes astray; out of proportion, what starts may change no longer says how.

    Args:
        trials: pieces whose starts were fitted to the nominal motion.
        config: of the robot.
        model: the nominal model.
        known: by trial the values of the rows that are not nominal.
    """
    found, bent = _refined(trials, config, model, known, RESTARTED)
    return found if bent > BENT else list(trials)


def _refined(
    trials: Sequence[Trial],
    config: OwnConfig,
    model: GapModel,
    known: Sequence[Mapping[str, float]],
    turns: int,
) -> tuple[list[Trial], float]:
    """Trials with starts that were fitted in so many turns, fewer if they stay, and how
    far a motion was from one in proportion, in deviations of its noise."""
    joints = [k for k, item in enumerate(config.seen) if item.state]
    told = {config.seen[k].state for k in joints}  # of others they say next to nothing
    made, noise = list(trials), np.array([config.seen[k].noise for k in joints])
    turning = [k for k in joints if config.seen[k].turning]
    expected: list[np.ndarray] = []
    bent = 0.0
    for _ in range(turns):
        names, (base, *ways) = model.started(made, known)
        if not names:
            break
        for path, there in zip(base, expected, strict=False):
            apart = np.nan_to_num((path - there)[:, joints] / noise)
            bent = max(bent, float(np.sqrt(np.mean(apart**2))))
        expected, farthest = [], 0.0
        for number, (trial, path) in enumerate(zip(made, base, strict=True)):
            change = np.stack([way[number] - path for way in ways])
            change[[start.inside(name) not in told for name in names]] = 0.0
            away = trial.observed - path
            away[:, turning] = wrapped(away[:, turning])
            units = away[:, joints] / noise
            size = _nearest(units, change[..., joints] / noise)
            sds = start.unsure(trial, config, {})
            expected.append(path + np.tensordot(size, change, axes=1))
            found = zip(names, size, strict=True)
            off = {n: float(z) * sds[n] for n, z in found if n in sds}
            made[number] = start.moved(trial, off, config) if off else trial
            farthest = max(farthest, float(np.abs(size).max()))
        if farthest < STILL:
            break
    return made, bent


def _nearest(units: np.ndarray, change: np.ndarray) -> np.ndarray:
    """Departures of the numbers of a start, in their standard deviations ``(K,)``.

    Args:
        units: residuals of the joints over their noise, ``(T, J)``.
        change: what one standard deviation of each number makes of them, ``(K, T, J)``.
    """
    seen = np.isfinite(units) & np.isfinite(change).all(axis=0)
    # a model that is off by more than the noise tells starts as badly as it is off
    square = np.where(seen, units, 0.0) ** 2
    off = np.sqrt(square.sum(axis=0) / np.maximum(seen.sum(axis=0), 1))
    units, change = units / np.maximum(off, 1.0), change / np.maximum(off, 1.0)
    design = change[:, seen].T
    curvature = design.T @ design + np.eye(len(change))
    return np.linalg.solve(curvature, design.T @ units[seen])


def _begun(
    part: Trial,
    whole: Trial,
    first: int,
    config: OwnConfig,
    beside: Mapping[str, list[float]] = MappingProxyType({}),
) -> Trial:
    found = {**beside, **state(whole, first, config)}
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

    A speed that is observed itself is taken as the mean around the sample. Where it is
    all that is seen of a joint, as of a flywheel, that has come as far since the first
    sample as its speeds say, and that counts as known.

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
        if item.state:
            values = trial.observed[near, column]
            values = np.unwrap(values) if item.turning else values
            found[item.state] = parabola(at, values, item.noise)
    for column, item in enumerate(config.seen):
        if item.quantity == "speed":
            mean, _, sd, _ = parabola(at, trial.observed[near, column], item.noise)
            if item.part in found:
                found[item.part][1::2] = mean, sd
            else:
                come = _come(trial.times[:row], trial.observed[:row, column])
                found[item.part] = [come, mean, 0.0, sd]
    return found


def _come(times: np.ndarray, speeds: np.ndarray) -> float:
    """How far samples of a speed say that something has come."""
    seen = np.isfinite(speeds)
    return float(np.trapezoid(speeds[seen], times[seen]))


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


GROWN = 30.0  # times an error of the start, from which what follows is of no use
SHORTEST = 0.4  # [s] of a piece
TURNED = 0.3  # [rad] by which a free body may be turned otherwise than foreseen, and
# what that changes still adds up; beyond, pieces are of `SHORTEST`


def foreseen(
    trials: Sequence[Trial],
    config: OwnConfig,
    physics: Simulation,
    model: GapModel,
) -> list[Trial]:
    """Trials in the pieces of the description; in shorter ones that begin in the states
    of the data, if any of them is not foreseen to its end and all that moves is
    observed.

    Args:
        trials: of a log, not cut.
        config: of the robot.
        physics: that simulates it.
        model: the nominal model.
    """
    made = _cut(trials, config, physics.unseen) if config.cut else list(trials)
    length = np.inf
    if _observed(config, physics.model):
        length = min(_lengths(made, config, model), default=np.inf)
    if np.isinf(length):
        return refined(made, config, model) if config.cut else made
    length = max(length, SHORTEST)
    found = _begun_anew(trials, config, model, length)
    if length > SHORTEST and _turned(found, config, model) > TURNED:
        found = _begun_anew(trials, config, model, SHORTEST)
    return found


def _cut(
    trials: Sequence[Trial], config: OwnConfig, unseen: Unseen | None = None
) -> list[Trial]:
    return [one for trial in trials for one in pieces(trial, config, unseen)]


def _begun_anew(
    trials: Sequence[Trial], config: OwnConfig, model: GapModel, length: float
) -> list[Trial]:
    """Trials in pieces of so many seconds, with starts that are refined."""
    return refined(_cut(trials, replace(config, cut=length)), config, model)


def _turned(trials: Sequence[Trial], config: OwnConfig, model: GapModel) -> float:
    """How far free bodies are turned otherwise than foreseen at most [rad], in the
    median of trials."""
    columns = [k for k, item in enumerate(config.seen) if item.floats and item.turning]
    if not columns:
        return 0.0
    (paths,) = model.paths(trials, [[{}] * len(trials)])
    apart = [
        np.nanmax(np.abs(wrapped((trial.observed - path)[:, columns])))
        for trial, path in zip(trials, paths, strict=True)
    ]
    return float(np.median(np.nan_to_num(apart, nan=np.pi)))


def _observed(config: OwnConfig, model: mujoco.MjModel) -> bool:
    """Whether each joint turns or slides and is seen, or carries a free body of which
    all is seen: then a state can be told."""
    seen = {item.part for item in config.seen if item.quantity == "joint"}
    bodies = {item.part for item in config.seen if item.floats}
    return all(
        model.joint(number).name in seen
        if prepared.hinged(model, number)
        else model.body(body).name in bodies
        for number, body in enumerate(model.jnt_bodyid)
    )


def _lengths(
    trials: Sequence[Trial], config: OwnConfig, model: GapModel
) -> Iterator[float]:
    """Seconds of each trial that are foreseen; infinity = all of it."""
    joints = [k for k, item in enumerate(config.seen) if item.state]
    noise = np.array([config.seen[k].noise for k in joints])
    names = [f"{start.NUMBERS[0]}[{config.seen[k].state}]" for k in joints]
    rng = np.random.default_rng(0)
    grown = [np.zeros(len(trial.times)) for trial in trials]
    sets = [dict.fromkeys(names, 0.0)]
    sets += [
        dict(zip(names, noise * rng.choice([-1, 1], len(noise)), strict=True))
        for _ in range(2)
    ]
    base, *moved = model.paths(trials, [[row] * len(trials) for row in sets])
    for way in moved:
        for size, one, other in zip(grown, base, way, strict=True):
            with np.errstate(invalid="ignore"):
                apart = np.abs(other - one)[:, joints] / noise
            worst = np.where(np.isfinite(one[:, joints]), apart, 0.0).max(axis=1)
            worst = np.nan_to_num(worst, nan=np.inf)
            np.maximum(size, worst, out=size)
    for size, trial in zip(grown, trials, strict=True):
        late = np.flatnonzero(size > GROWN)
        first = late[0] if len(late) else -1
        yield float(trial.times[first] - trial.times[0]) if len(late) else np.inf
