"""Numbers of a description that the data tell: units of time, noise, limits, start."""

from collections.abc import Mapping, Sequence

import mujoco
import numpy as np

from bns.gap.decomposition.rest import NORMAL, THIRD
from bns.gap.models.mjcf import prepared
from bns.worlds.data.units import FACTORS

RATES = (4.0, 5000.0)  # [Hz] of logs
USUAL = 0.01  # [s] between samples; the unit that comes nearest is taken
LONG = 8.0  # [s] a trial that is longer, and told anew all the time, is cut
CUT = 3.0  # [s]
ANEW = 0.1  # [s] between new commands, up to which they are a curve
SETTLE = 0.5  # [s]
LONGEST = 5.0  # [s] of settling
STILL = 3e-4  # [rad or m] that what rests moves at most in `SETTLE`
CREEPING = 3e-3  # the same of what stands on feet that creep (assumed)
BACK = 0.05  # of how far a joint was away: it is back
HARDLY = 2.0  # times the least that it moves: hardly more
NEAR = 0.05  # of a joint's range, by which a start may be off
SIGMAS = 6.0  # times the noise, the same
PAD = 0.02  # of the range of commands, by which limits are wider


def time_unit(times: np.ndarray) -> str:
    """The unit of stamps ``(T,)``: the one that makes their rate that of a log."""
    steps = np.diff(times)
    step = float(np.median(steps[steps > 0])) if (steps > 0).any() else USUAL
    rated = {
        name: abs(np.log(step * factor / USUAL))
        for name, factor in FACTORS["s"].items()
        if 1 / RATES[1] <= step * factor <= 1 / RATES[0]
    }
    return min(rated, key=rated.__getitem__) if rated else "s"


def noise(pieces: Sequence[np.ndarray]) -> float:
    """Standard deviation of a channel's measurement, by third differences.

    At least that of rounding to the smallest step between its samples.

    Args:
        pieces: samples of each trial, ``(T,)``, NaN where there is none.
    """
    kept = [piece[np.isfinite(piece)] for piece in pieces]
    third = np.concatenate([np.abs(np.diff(piece, n=3)) for piece in kept])
    steps = np.concatenate([np.abs(np.diff(piece)) for piece in kept])
    steps = steps[steps > 0]
    span = max((float(np.ptp(piece)) for piece in kept if len(piece)), default=1.0)
    found = NORMAL * float(np.median(third)) / THIRD if len(third) else 0.0
    rounding = float(steps.min()) / np.sqrt(12.0) if len(steps) else 0.0
    return max(found, rounding, 1e-5 * span, 1e-9)


def limits(told: np.ndarray, allowed: tuple[float, float]) -> tuple[float, float]:
    """Lowest and highest command: what was told, ``(T,)``, and a little more, within
    bounds; all in the unit of the command."""
    low, high = float(told.min()), float(told.max())
    pad = PAD * max(high - low, 1e-3 * max(abs(low), abs(high)), 1e-6)
    return max(low - pad, min(allowed[0], low)), min(high + pad, max(allowed[1], high))


def curved(told: np.ndarray, span: float) -> bool:
    """Whether commands, ``(T, C)``, change all the time in so many seconds."""
    return bool(changed(told).sum() * ANEW > span)


def changed(told: np.ndarray) -> np.ndarray:
    """After which samples commands ``(T, C)`` are others, ``(T - 1,)``."""
    return (np.diff(told, axis=0) != 0).any(axis=1)


def rests(
    model: mujoco.MjModel, first: Mapping[str, float], tolerance: Mapping[str, float]
) -> tuple[str | None, float]:
    """The pose in which trials begin: a keyframe's name or "" and how long it settles.

    Args:
        model: that is recorded.
        first: where each joint is at the start of a trial.
        tolerance: by how much that may be off.

    Returns:
        the keyframe ("" = the model's own pose), None = none fits; settling time [s].
    """
    for settled in (False, True):
        for name in reversed(_poses(model)):  # keyframes before the model's own pose
            lasting = settling(model, name) if settled else 0.0
            data = prepared.posed(model, name, lasting)
            off = [
                abs(float(data.joint(joint).qpos[0]) - at) <= tolerance[joint]
                for joint, at in first.items()
            ]
            if off and all(off):
                if not settled and _moved(model, data) > 1e-5:
                    lasting = settling(model, name)
                return name, lasting
    return None, 0.0


def settling(model: mujoco.MjModel, pose: str) -> float:
    """How long a model settles in a pose until it rests [s]: whole times of `SETTLE`.
    Feet creep: where it does not rest within `LONGEST`, until it moves hardly more than
    it ever does; one of them, where it moves on.

    Args:
        model: that is recorded.
        pose: name of the keyframe; "" = the model's own.
    """
    data, moved = prepared.posed(model, pose, 0.0), []
    for _ in range(round(LONGEST / SETTLE) + 1):
        moved.append(_moved(model, data))
        if moved[-1] < STILL:
            break
    least = min(moved)
    if least > CREEPING:
        return SETTLE
    still = np.flatnonzero(np.array(moved) <= max(HARDLY * least, STILL))[0]
    return max(int(still), 1) * SETTLE


def returning(model: mujoco.MjModel, pose: str, begun: Mapping[str, float]) -> float:
    """How long a model takes to come back to a pose [s], whole times of `SETTLE`: what
    does rests elsewhere once something pulls at it. 0 = it does not within `LONGEST`.

    Args:
        model: that is recorded; rests in the pose.
        pose: name of the keyframe; "" = the model's own.
        begun: joints that are elsewhere, and where; none = 0.
    """
    data = prepared.posed(model, pose, 0.0)
    goal = {joint: float(data.joint(joint).qpos[0]) for joint in begun}
    for joint, at in begun.items():
        data.joint(joint).qpos[0] = at
    steps = round(SETTLE / model.opt.timestep)
    for count in range(round(LONGEST / SETTLE) if begun else 0):
        most = 0.0  # it may swing through
        for _ in range(steps):
            mujoco.mj_step(model, data)
            off = (
                (data.joint(joint).qpos[0] - goal[joint]) / (at - goal[joint])
                for joint, at in begun.items()
            )
            most = max(most, *(abs(float(share)) for share in off))
        if most < BACK:
            return max(count, 1) * SETTLE
    return 0.0


def nearest(model: mujoco.MjModel, first: Mapping[str, float]) -> str:
    """The keyframe whose joints are nearest to where they were at the start of a trial,
    the last of those that are as near; "" = the model's own pose.

    Args:
        model: that is recorded.
        first: where each joint was.
    """

    def away(name: str) -> float:
        data = prepared.posed(model, name, 0.0)
        return sum(abs(float(data.joint(j).qpos[0]) - at) for j, at in first.items())

    return min(reversed(_poses(model)), key=away)


def _poses(model: mujoco.MjModel) -> list[str]:
    """Names of the keyframes, after "" for the model's own pose."""
    return ["", *(model.key(k).name for k in range(model.nkey) if model.key(k).name)]


def _moved(model: mujoco.MjModel, data: mujoco.MjData) -> float:
    """How far a coordinate of the model goes at most in the next `SETTLE`."""
    before = data.qpos.copy()
    for _ in range(round(SETTLE / model.opt.timestep)):
        mujoco.mj_step(model, data)
    return float(np.abs(data.qpos - before).max(initial=0.0))
