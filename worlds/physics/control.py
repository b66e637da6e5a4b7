"""From lists of commands to what the actuators get at each physics step.

A servo that is told a new goal moves there at its moving speed: the goal in force is a
ramp. A walking robot's commands are planned to last as long as the longest ramp and
`SETTLE`; the physics makes them longer where the robot has not come to rest
(`bns.worlds.physics.rollout`).
"""

from collections.abc import Sequence
from itertools import pairwise

import numpy as np

from bns.errors import BnsError, OutOfBoundsError
from bns.models.ax12a import UNIT
from bns.worlds.active import Placed
from bns.worlds.effects.base import CommandEffect, ControlSignal
from bns.worlds.trial import Commands

_ROUNDING = 1 + 1e-9  # by which a value may exceed its limit
LONGEST = 3600.0  # [s] a trial; assumed: longer ones are slips of a unit


def check(
    commands: Commands,
    channels: Sequence[tuple[str, str]],
    limits: np.ndarray,
    robot: str,
) -> None:
    """Stop if a robot cannot be told these commands.

    Args:
        commands: one robot's list.
        channels: what the robot is told, with units.
        limits: largest magnitude per channel, shape ``(C,)``; or smallest and largest
            value, shape ``(C, 2)``.
        robot: its name, for the message.

    Raises:
        BnsError: other channels or units, no command at all.
        OutOfBoundsError: a value beyond the limit, a trial beyond `LONGEST`.
    """
    if commands.channels is not channels and tuple(commands.channels) != tuple(
        channels
    ):
        raise BnsError(
            f"Robot {robot!r} is told {_listed(channels)}; these commands have "
            f"{_listed(commands.channels)}."
        )
    if not len(commands):
        raise BnsError("A list of commands is empty; give one command at least.")
    if commands.duration > LONGEST:
        raise OutOfBoundsError("trial", commands.duration, 0, LONGEST, "s")
    low, high = (
        np.array(limits.T if limits.ndim == 2 else (-limits, limits)) * _ROUNDING
    )
    beyond = np.argwhere((commands.values < low) | (commands.values > high))
    if len(beyond):
        row, column = beyond[0]
        name, unit = channels[column]
        limit, given = limits[column], commands.values[row, column]
        least, most = limit if limits.ndim == 2 else (-limit, limit)
        raise OutOfBoundsError(f"command {row}: {name}", given, least, most, unit)


def _listed(channels: Sequence[tuple[str, str]]) -> str:
    return ", ".join(f"{name} [{unit}]" for name, unit in channels)


def steps(durations: np.ndarray, dt: float) -> np.ndarray:
    """Physics steps that each command is held, shape ``(K,)``, at least 1."""
    return np.maximum(np.rint(durations / dt), 1).astype(np.int64)


def signal(commands: Commands, counts: np.ndarray, dt: float) -> ControlSignal:
    """The commands on the physics grid; it ends with the last command.

    Args:
        commands: K commands.
        counts: physics steps of each, shape ``(K,)``.
        dt: physics step [s].
    """
    command = np.repeat(np.arange(len(counts)), counts)
    return ControlSignal(
        times=np.arange(len(command)) * dt,
        values=commands.values[command],
        command=command,
        channels=tuple(channel.name for channel in commands.channels),
        dt=dt,
    )


def disturbed(
    given: ControlSignal,
    effects: Sequence[Placed[CommandEffect]],
    seed: int,
    trial: int,
) -> np.ndarray:
    """The signal's values after the command and actuator effects, ``(S, C)``.

    Args:
        given: the commands on the physics grid.
        effects: applied in order, each where it is active.
        seed: of the effects that draw.
        trial: number of the trial.
    """
    for placed in effects:
        values = placed.effect.apply(
            given, placed.active(given.times), placed.generator(seed, trial)
        )
        given = ControlSignal(
            given.times, values, given.command, given.channels, given.dt
        )
    return given.values


def step_at(moment: float, dt: float) -> int:
    """The first physics step that starts at or after a moment [s]."""
    return int(np.ceil(moment / dt - 1e-9))


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
