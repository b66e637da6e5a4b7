"""Wheel intermittent: every m-th command of a wheel is lost."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter
from bns.worlds.effects.common import TOP_SPEED, WHEEL, columns, rarer


class WheelIntermittent(CommandEffect):
    """In every m-th command of a trial the wheel turns at its minimum instead."""

    name = "wheel_intermittent"
    doc = "a wheel stops (or slows to a minimum) in every m-th command"
    source = "thesis 6.2.1 (stops spinning) and 6.3.1 (set to the minimum); m is silent"
    memoryless = True
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "every",
            unit="1",
            nominal=0,
            low=0,
            high=1000,
            doc="m: commands m, 2m, ... of a trial are hit; 0 = never; bounds assumed",
            example=3,
            integer=True,
        ),
        Parameter(
            "speed",
            unit="m/s",
            nominal=0.0,
            low=0.0,
            high=TOP_SPEED,
            doc="speed in the commands hit; 0 = stops, 0.0555 = 8,000 speed units",
            example=0.0,
            scales=False,
        ),
    )

    def scaled(self, severity: float) -> "WheelIntermittent":
        """Milder means rarer: half the severity hits half as many commands."""
        every = rarer(self, severity)
        return type(self)({**super().scaled(severity).values, "every": every})

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        values = signal.values.copy()
        if self.is_nominal:
            return values
        number = signal.command + 1  # counted from 1; 0 after the last command
        hit = active & (number > 0) & (number % int(self["every"]) == 0)
        for column in columns(self, signal):
            values[hit, column] = self["speed"]
        return values
