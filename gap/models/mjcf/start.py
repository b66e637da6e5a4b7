"""Where a recorded trial begins: the state of the joints, and what was told before."""

from collections.abc import Mapping

import mujoco
import numpy as np

from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.view import View
from bns.worlds.trial import Trial

STATE = "start"
"""condition of a trial that begins in motion: by joint its position and speed"""

UNSURE = "start_unsure"
"""condition of such a trial: by joint the standard deviations of these"""

NUMBERS = ("start_position", "start_speed")
"""numbers of a start that are not known, each with its joint in brackets"""

BEFORE, STEP = "told_before", "told_before_step"
"""conditions: commands before it, a row each, and the time between two [s]"""


def place(data: mujoco.MjData, trial: Trial, view: View) -> None:
    """Set the joints to where they were at the start of a trial.

    Joints whose state the trial's conditions hold get it, with their speeds; else those
    that were observed start at their first sample, at rest.

    Args:
        data: of the simulation; written to.
        trial: recorded trial.
        view: which joint each observed column is.
    """
    state = trial.conditions.get(STATE)
    if not isinstance(state, dict):
        seen = trial.observed[np.isfinite(trial.observed).all(axis=1)]
        view.place(data, seen[0])
        return
    for joint, (position, speed) in state.items():
        data.joint(joint).qpos[0] = position
        data.joint(joint).qvel[0] = speed


def unsure(trial: Trial, config: OwnConfig) -> dict[str, float]:
    """Standard deviations of the numbers of a trial's start that come from data, by
    name: "start_speed[elbow]".

    Args:
        trial: recorded trial.
        config: of the robot; its joints begin where they were seen if it says so.
    """
    found = trial.conditions.get(UNSURE)
    if isinstance(found, dict):
        return {
            f"{number}[{joint}]": float(sd)
            for joint, sds in found.items()
            for number, sd in zip(NUMBERS, sds, strict=True)
        }
    if not config.recorded:
        return {}
    joints = [item for item in config.seen if item.quantity == "joint"]
    return {f"{NUMBERS[0]}[{item.part}]": item.noise for item in joints}


def moved(trial: Trial, off: Mapping[str, float], config: OwnConfig) -> Trial:
    """A trial that begins in another state.

    Args:
        trial: recorded trial.
        off: departures of numbers of its start, by name as in `unsure`.
        config: of the robot.
    """
    state = trial.conditions.get(STATE)
    if not isinstance(state, dict):
        seen = trial.observed[np.isfinite(trial.observed).all(axis=1)][0]
        joints = [k for k, item in enumerate(config.seen) if item.quantity == "joint"]
        state = {config.seen[k].part: [float(seen[k]), 0.0] for k in joints}
    state = {
        joint: [
            value + off.get(f"{number}[{joint}]", 0.0)
            for number, value in zip(NUMBERS, values, strict=True)
        ]
        for joint, values in state.items()
    }
    return trial.replace(conditions={**trial.conditions, STATE: state})


def before(
    trial: Trial, rest: np.ndarray, count: int, config: OwnConfig, dt: float
) -> np.ndarray:
    """Commands at the physics steps before a trial, ``(count, C)``.

    Those that were recorded, and before them the first of these; at rest if none were.
    A trial that starts where it was recorded was told its first command before.

    Args:
        trial: recorded trial.
        rest: commands that hold the robot at rest, ``(C,)``.
        count: number of steps.
        config: of the robot.
        dt: physics step [s].
    """
    rows = trial.conditions.get(BEFORE)
    if not isinstance(rows, list) or not rows:
        first = trial.commands.values[0] if config.recorded else rest
        return np.tile(first, (count, 1))
    step = float(str(trial.conditions[STEP]))
    past = (np.arange(count, 0, -1)) * dt  # [s] before the start
    at = len(rows) - np.ceil(past / step - 1e-9).astype(int)
    return np.array(rows, dtype=float)[np.clip(at, 0, None)]
