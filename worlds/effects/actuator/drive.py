"""Drives: what lies between a motor and its wheel."""

import numpy as np

from bns.worlds.effects.base import ActuatorEffect, ControlSignal, strength
from bns.worlds.effects.common import WHEEL, columns, spans


class MotorLag(ActuatorEffect):
    """The wheels follow their commands with a first-order lag.

    Solved exactly for commands that are constant over a physics step: a step from rest
    has reached 1 - 1/e = 63.2 % at the time constant.
    """

    name = "motor_lag"
    source = "first-order model assumed; the lab's robot loses 0.07-0.14 s from rest"
    choices = (WHEEL,)
    parameters = (
        strength(
            "time_constant",
            "s",
            (0.0, 2.0),
            "time to 63 % of a step; bounds assumed",
            example=0.2,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """See `CommandEffect.apply`."""
        values = signal.values.copy()
        if self.is_nominal:
            return values
        from scipy.signal import lfilter

        keep = np.exp(-signal.dt / self["time_constant"])
        for column in columns(self, signal):
            told = signal.values[:, column]
            for span in spans(active):
                before = told[span.start - 1] if span.start else 0.0  # starts at rest
                values[span, column], _ = lfilter(
                    [1 - keep], [1, -keep], told[span], zi=[keep * before]
                )
        return values


class WheelBacklash(ActuatorEffect):
    """Play between motor and wheel: travel is lost at each reversal.

    The motor turns as it is told; the wheel stands still while the play is open. A
    trial, or the effect, begins with the play half open either way.
    """

    name = "wheel_backlash"
    source = "play operator (Nordin and Gutman, Automatica 38, 2002); bounds assumed"
    choices = (WHEEL,)
    parameters = (
        strength(
            "play",
            "m",
            (0.0, 0.05),
            "full play at the wheel's rim, angle times radius; bounds assumed",
            example=0.005,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """See `CommandEffect.apply`."""
        values = signal.values.copy()
        if self.is_nominal:
            return values
        half = self["play"] / 2
        for column in columns(self, signal):
            for span in spans(active):
                motor = np.cumsum(signal.values[span, column]) * signal.dt  # [m]
                wheel = _played(motor, half)
                values[span, column] = np.diff(wheel, prepend=0.0) / signal.dt
        return values


def _played(motor: np.ndarray, half: float) -> np.ndarray:
    """Travel of what follows with play, ``(S,)``, from the middle of the play."""
    followed, at = np.empty_like(motor), 0.0
    for step, moved in enumerate(motor):
        at = min(max(at, moved - half), moved + half)
        followed[step] = at
    return followed
