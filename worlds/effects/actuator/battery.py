"""Batteries: the speed reached falls with use."""

import numpy as np

from bns.worlds.effects.base import ActuatorEffect, ControlSignal, Parameter, strength


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

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """See `CommandEffect.apply`."""
        values = signal.values.copy()
        if self.is_nominal:
            return values
        speed = np.abs(signal.values).mean(axis=1)  # [m/s] of the two wheels
        rate = self["per_second"] + self["per_metre"] * speed  # [1/s]
        loss = np.where(active, rate * signal.dt, 0.0)
        left = np.exp(-(np.cumsum(loss) - loss))  # at the start of each step
        values[active] *= left[active, None]
        return values


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

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """See `CommandEffect.apply`."""
        values = signal.values.copy()
        if not self.is_nominal:
            values[active] *= np.exp(-self["per_trial"] * self["trials"])
        return values
