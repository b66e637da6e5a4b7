"""Dead band: slow speeds give a stop."""

import numpy as np

from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter
from bns.worlds.effects.common import WHEEL, columns


class DeadBand(CommandEffect):
    """Speeds of a magnitude below a threshold give a stop."""

    name = "dead_band"
    doc = "speeds below a magnitude give a stop"
    source = "regulated minimum 2,000 units (13.9 mm/s): Khepera III manual 2.2 p. 14"
    memoryless = True
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "speed",
            unit="m/s",
            nominal=0.0,
            low=0.0,
            high=0.2,
            doc="smallest magnitude that still moves the wheel; bounds assumed",
            example=0.08,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        values = signal.values.copy()
        for column in columns(self, signal):
            slow = np.abs(values[:, column]) < self["speed"]
            values[active & slow, column] = 0.0
        return values
