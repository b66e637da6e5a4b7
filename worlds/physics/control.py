"""From lists of commands to what the actuators get at each physics step."""

from collections.abc import Sequence

import numpy as np

from bns.errors import BnsError, OutOfBoundsError
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
