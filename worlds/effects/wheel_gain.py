"""Wheel gain: a wheel turns at a share of the speed it is told."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter
from bns.worlds.effects.common import WHEEL, columns


class WheelGain(CommandEffect):
    """The command of one or both wheels is scaled, hidden from the learner."""

    name = "wheel_gain"
    doc = "a wheel turns at a share of the speed it is told"
    source = "thesis 4.2.3 and 6.2.1: a wheel slowed to a share of its intended speed"
    memoryless = True
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=2.0,
            doc="speed reached over speed told; bounds assumed",
            example=0.8,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        values = signal.values.copy()
        for column in columns(self, signal):
            values[active, column] *= self["factor"]
        return values
