"""Speed saturation: a wheel turns no faster than a limit."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter
from bns.worlds.effects.common import TOP_SPEED, WHEEL, columns


class SpeedSaturation(CommandEffect):
    """Speeds beyond a limit, forward or backward, are cut to it."""

    name = "speed_saturation"
    doc = "a wheel turns no faster than a limit"
    source = "limits of 48,000 and 43,000 units: Khepera III manual 2.2 p. 14"
    memoryless = True
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "limit",
            unit="m/s",
            nominal=TOP_SPEED,
            low=0.0,
            high=TOP_SPEED,
            doc="largest magnitude; the nominal is the limit of the drive",
            example=0.06,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        values = signal.values.copy()
        if self.is_nominal:
            return values
        limit = self["limit"]
        for column in columns(self, signal):
            values[active, column] = np.clip(values[active, column], -limit, limit)
        return values
