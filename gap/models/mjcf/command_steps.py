"""What actuators are told in each step of a simulation of a recorded trial."""

from collections.abc import Sequence
from dataclasses import replace

import mujoco
import numpy as np

from bns.gap.models.mjcf import start
from bns.gap.models.mjcf.config import OwnConfig
from bns.worlds.effects.base import CommandEffect, ControlSignal, Effect
from bns.worlds.effects.parts import FILTERS
from bns.worlds.trial import Trial

LEAD = 1.0  # [s] of rest before a trial, so that what is late has something before it
ON = 1e-6  # of a step, by which a command that ends with one may be off


def arriving(
    trial: Trial,
    effects: Sequence[Effect],
    rest: np.ndarray,
    config: OwnConfig,
    dt: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Commands at each step after the effects: those of the last `LEAD` before, and
    those of the trial, settling included, ``(S, K)`` each.

    Args:
        trial: recorded.
        effects: of any stage.
        rest: commands that hold the robot at rest, ``(K,)``.
        config: of the robot.
        dt: step [s].
    """
    values, number = stepped(trial, dt)
    lead, extra = round(config.settle / dt), round(LEAD / dt)
    before = start.before(trial, rest, lead + extra, config, dt)
    values = np.concatenate([before, values])
    signal = ControlSignal(
        times=np.arange(len(values)) * dt,
        values=values,
        command=np.concatenate([np.full(len(before), -1), number]),
        channels=tuple(item.channel.name for item in config.told),
        dt=dt,
    )
    on, rng = np.ones(len(values), bool), np.random.default_rng(0)
    for effect in effects:
        if isinstance(effect, CommandEffect) and effect.stage == "command":
            signal = replace(signal, values=effect.apply(signal, on, rng))
    return signal.values[:extra], signal.values[extra:]


def filtered(
    before: np.ndarray, model: mujoco.MjModel, actuators: Sequence[int]
) -> dict[int, float]:
    """What a model's filters have made of commands that went before a trial, by the
    address of each activation.

    Args:
        before: commands at the steps before, ``(S, K)``.
        model: that is simulated.
        actuators: number of each channel's actuator.
    """
    found, dt = {}, model.opt.timestep
    ago = np.arange(len(before) - 1, 0, -1) * dt
    for number, told in zip(actuators, before.T, strict=True):
        if model.actuator_dyntype[number] in FILTERS:
            if model.actuator_ctrllimited[number]:
                told = np.clip(told, *model.actuator_ctrlrange[number])
            lag = max(float(model.actuator_dynprm[number, 0]), dt)
            come = 1 - np.exp(-ago / lag)
            at = int(model.actuator_actadr[number])
            found[at] = float(told[0] + come @ np.diff(told))
    return found


def stepped(trial: Trial, dt: float) -> tuple[np.ndarray, np.ndarray]:
    """What is told in each step of a simulation, and the number of that command.

    In a step in which a command ends, it is the mean over the step: else a piece whose
    commands end between steps would be told all of them too late or too early. What
    MuJoCo itself recorded had ends that were rounded.

    Args:
        trial: recorded.
        dt: step [s].

    Returns:
        commands ``(S, K)`` and numbers ``(S,)``.
    """
    told = trial.commands.values
    ends = np.cumsum(trial.commands.durations) / dt
    near = np.abs(ends - np.rint(ends)) < ON
    ends = np.where(near | ("mujoco" in trial.conditions), np.rint(ends), ends)
    steps = np.arange(round(float(ends[-1])))
    middle = np.searchsorted(ends, steps + 0.5, side="right")
    number = np.minimum(middle, len(told) - 1)
    values = told[number]
    cut = np.unique(np.floor(ends[:-1][ends[:-1] % 1 > 0]).astype(int))
    cut = cut[cut < len(steps)]
    area = np.vstack(
        [0 * told[:1], np.cumsum(told * np.diff(ends, prepend=0)[:, None], 0)]
    )
    marks = np.append(0.0, ends)
    for column, total in enumerate(area.T):
        upto = np.interp(np.stack([cut, cut + 1]), marks, total)
        values[cut, column] = np.clip(
            upto[1] - upto[0], told[:, column].min(), told[:, column].max()
        )
    return values, number
