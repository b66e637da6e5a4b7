"""From commands of a walking robot to what its servos get at each physics step.

A servo that is told a new goal moves there at its moving speed: the goal in force is a
ramp. Commands are planned to last as long as the longest ramp and `SETTLE`; the physics
makes them longer where the robot has not come to rest (`legged_physics`).
"""

from itertools import pairwise

import numpy as np

from bns.models.ax12a import UNIT
from bns.worlds.trial import Commands

SETTLE = 0.2  # [s] after the ramps, until a first look whether the robot rests; chosen


def planned(commands: Commands, speed: float, dt: float) -> np.ndarray:
    """Physics steps of each command as planned, shape ``(K,)``.

    Args:
        commands: goals [rad]; their durations are the limits.
        speed: moving speed of the servos [rad/s].
        dt: physics step [s].
    """
    goals = np.vstack([np.zeros((1, commands.values.shape[1])), commands.values])
    ramps = np.abs(np.diff(goals, axis=0)).max(axis=1) / speed
    wanted = np.minimum(ramps + SETTLE, commands.durations)
    return np.maximum(np.ceil(wanted / dt - 1e-9), 1).astype(np.int64)


def limits(commands: Commands, dt: float) -> np.ndarray:
    """Physics steps that each command may take, shape ``(K,)``."""
    return np.maximum(np.rint(commands.durations / dt), 1).astype(np.int64)


def in_units(goals: np.ndarray, step: np.ndarray | float = UNIT) -> np.ndarray:
    """Goals as the registers hold them: rounded to steps [rad], 0 = not at all."""
    step = np.asarray(step)
    safe = np.where(step > 0, step, 1.0)
    return np.where(step > 0, np.rint(goals / safe) * safe, goals)


def shaped(
    goals: np.ndarray, laws: dict[str, np.ndarray], start: np.ndarray, dt: float
) -> np.ndarray:
    """What of the servo law acts on goals: units, delay, lag, mounting.

    Args:
        goals: on the physics grid, shape ``(S, C)`` [rad].
        laws: numbers of the servos, each of shape ``(C,)``.
        start: goals in force before, shape ``(C,)``.
        dt: physics step [s].

    Returns:
        New goals in the joints' own angles, shape ``(S, C)``.
    """
    goals = in_units(goals, laws["quantisation"])
    for column in np.flatnonzero(laws["delay"]):
        goals[:, column] = _late(
            goals[:, column], start[column], laws["delay"][column] / dt
        )
    for column in np.flatnonzero(laws["lag"]):
        goals[:, column] = _lagged(
            goals[:, column], start[column], laws["lag"][column] / dt
        )
    return goals - laws["offset"]


def _late(goals: np.ndarray, start: float, steps: float) -> np.ndarray:
    late = round(float(steps))
    return np.concatenate([np.full(late, start), goals])[: len(goals)]


def _lagged(goals: np.ndarray, start: float, steps: float) -> np.ndarray:
    from scipy.signal import lfilter

    keep = np.exp(-1 / steps)
    made, _ = lfilter([1 - keep], [1, -keep], goals, zi=[keep * start])
    return made


def ramps(goals: np.ndarray, start: np.ndarray, most: float) -> np.ndarray:
    """Goals in force: they move to the goals told by so much a step at most.

    Args:
        goals: told, on the physics grid, shape ``(S, C)`` [rad].
        start: in force before, shape ``(C,)``.
        most: change per step [rad].

    Returns:
        Shape ``(S, C)``.
    """
    changed = np.flatnonzero((goals[1:] != goals[:-1]).any(axis=1)) + 1
    made = np.empty_like(goals)
    for begin, end in pairwise([0, *changed, len(goals)]):
        ahead = goals[begin] - start
        reach = most * np.arange(1, end - begin + 1)[:, None]
        made[begin:end] = start + np.clip(ahead, -reach, reach)
        start = made[end - 1]
    return made
