"""How far ahead a model foresees its own recording: trials of robots that are unstable
under the commands alone are cut to that length.

A pole that starts upright falls to the side to which the start was off. Compared all
along, it would say nothing but that; compared over pieces that begin in the states of
the data, it is a robot like others.
"""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import mujoco
import numpy as np

from bns.gap.models.base import GapModel
from bns.gap.models.mjcf import cuts, start
from bns.gap.models.mjcf.config import OwnConfig
from bns.worlds.trial import Trial

GROWN = 30.0  # times an error of the start, from which what follows is of no use
SHORTEST = 0.4  # [s] of a piece


def foreseen(
    trials: Sequence[Trial], config: OwnConfig, physics: mujoco.MjModel, model: GapModel
) -> list[Trial]:
    """Trials, cut into pieces that begin in the states of the data if any of them is
    not foreseen to its end and all that moves is observed.

    Args:
        trials: of a log, not cut.
        config: of the robot.
        physics: its MJCF, compiled.
        model: the nominal model.
    """
    if not _observed(config, physics):
        return list(trials)
    length = min(_lengths(trials, config, model), default=np.inf)
    if np.isinf(length):
        return list(trials)
    cut = replace(config, cut=max(length, SHORTEST))
    pieces = [piece for trial in trials for piece in cuts.pieces(trial, cut)]
    return cuts.refined(pieces, config, model)


def _observed(config: OwnConfig, model: mujoco.MjModel) -> bool:
    """Whether each joint turns or slides and is seen: then a state can be told."""
    seen = {item.part for item in config.seen if item.quantity == "joint"}
    kinds = (mujoco.mjtJoint.mjJNT_HINGE, mujoco.mjtJoint.mjJNT_SLIDE)
    return all(
        int(model.jnt_type[number]) in map(int, kinds)
        and model.joint(number).name in seen
        for number in range(model.njnt)
    )


def _lengths(
    trials: Sequence[Trial], config: OwnConfig, model: GapModel
) -> Iterator[float]:
    """Seconds of each trial that are foreseen; infinity = all of it."""
    joints = [k for k, item in enumerate(config.seen) if item.quantity == "joint"]
    noise = np.array([config.seen[k].noise for k in joints])
    names = [f"{start.NUMBERS[0]}[{config.seen[k].part}]" for k in joints]
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
