"""The drive of wheels: lag, play, and the battery behind it."""

import numpy as np

from bns.worlds.effects.base import ActuatorEffect, ControlSignal, Parameter, strength
from bns.worlds.effects.common import WHEEL, columns, lagged, spans


class MotorLag(ActuatorEffect):
    """The wheels follow their commands with a first-order lag.

    A step from rest has reached 1 - 1/e = 63.2 % at the time constant; a physics step
    is driven at the mean speed over it.
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

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        for column in columns(self, signal):
            told = signal.values[:, column]
            for span in spans(active):
                before = told[span.start - 1] if span.start else 0.0  # starts at rest
                told[span] = lagged(
                    told[span], before, self["time_constant"], signal.dt
                )


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

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        half = self["play"] / 2
        for column in columns(self, signal):
            for span in spans(active):
                motor = np.cumsum(signal.values[span, column]) * signal.dt  # [m]
                wheel = _played(motor, half)
                signal.values[span, column] = np.diff(wheel, prepend=0.0) / signal.dt


def _played(motor: np.ndarray, half: float) -> np.ndarray:
    """Travel of what follows with play, ``(S,)``, from the middle of the play."""
    followed, at = np.empty_like(motor), 0.0
    for step, moved in enumerate(motor):
        at = min(max(at, moved - half), moved + half)
        followed[step] = at
    return followed


class BatterySag(ActuatorEffect):
    """The speed reached falls during a trial, with time and with use.

    Every trial starts with a full battery (worlds hold no state between trials); a
    decline over trials is a `wheel_gain` with a ramp.
    """

    name = "battery_sag"
    source = "assumed: speed in proportion to supply, exponential discharge"
    parameters = (
        strength(
            "per_second",
            "1/s",
            (0.0, 0.2),
            "share of the speed lost per second; bounds assumed",
            example=0.01,
        ),
        strength(
            "per_metre",
            "1/m",
            (0.0, 2.0),
            "share of the speed lost per metre told to drive; bounds assumed",
            example=0.05,
        ),
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        speed = np.abs(signal.values).mean(axis=1)  # [m/s] of the two wheels
        rate = self["per_second"] + self["per_metre"] * speed  # [1/s]
        loss = np.where(active, rate * signal.dt, 0.0)
        left = np.exp(-(np.cumsum(loss) - loss))  # at the start of each step
        signal.values[active] *= left[active, None]


class BatteryFade(ActuatorEffect):
    """The speed reached falls from trial to trial.

    In an experiment the trials since the onset are counted; with a recurrence the
    battery is charged at the start of every period.
    """

    name = "battery_fade"
    source = "assumed: speed in proportion to supply, exponential discharge"
    parameters = (
        strength(
            "per_trial",
            "1",
            (0.0, 0.5),
            "share of the speed lost with each trial; bounds assumed",
            example=0.02,
        ),
        Parameter(
            "trials",
            unit="1",
            nominal=0,
            low=0,
            high=1_000_000,
            doc="driven since the battery was full, before the first one",
            example=10,
            integer=True,
            scales=False,
        ),
    )

    @property
    def is_nominal(self) -> bool:
        """Whether nothing is lost, at all or yet."""
        return super().is_nominal or not self["trials"]

    def in_trial(self, since: int) -> "BatteryFade":
        """The effect after so many trials more."""
        return type(self)({**self.values, "trials": self["trials"] + since})

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        signal.values[active] *= np.exp(-self["per_trial"] * self["trials"])
