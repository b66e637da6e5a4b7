"""What the two stuck-wheel effects share."""

import numpy as np

from bns.worlds.effects.base import Choice, CommandEffect, ControlSignal, Parameter
from bns.worlds.effects.common import TOP_SPEED, WHEEL, columns

DIRECTION = Choice(
    "direction",
    ("forward", "backward", "commanded"),
    "forward",
    "which way the stuck wheel turns; commanded = the way it is told, or not at all",
)

BLEND = Parameter(
    "blend",
    unit="1",
    nominal=0.0,
    low=0.0,
    high=1.0,
    doc="from the speed told (0) to the stuck speed (1)",
    example=1.0,
)


def stuck_speed(nominal: float, doc: str) -> Parameter:
    """The parameter for the speed at which a wheel is stuck [m/s]."""
    return Parameter(
        "speed",
        unit="m/s",
        nominal=nominal,
        low=0.0,
        high=TOP_SPEED,
        doc=doc,
        example=nominal,
        scales=False,
    )


class StuckWheel(CommandEffect):
    """A wheel turns at one speed whatever it is told, as long as commands last."""

    choices = (WHEEL, DIRECTION)
    memoryless = True

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        values = signal.values.copy()
        if self.is_nominal:
            return values
        on = active & (signal.command >= 0)
        signs = {"forward": 1.0, "backward": -1.0}
        for column in columns(self, signal):
            told = values[on, column]
            sign = signs.get(self["direction"], np.sign(told))
            values[on, column] += self["blend"] * (sign * self["speed"] - told)
        return values
