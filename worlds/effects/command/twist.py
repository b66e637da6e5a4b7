"""Commands of robots told a forward speed and a turning rate."""

import numpy as np

from bns.errors import UnknownNameError
from bns.worlds.effects.base import CommandEffect, ControlSignal, Parameter

TWIST = ("forward_speed", "turning_rate")
"""names of the two channels"""


class TurningLoss(CommandEffect):
    """Forward speed is lost while the robot turns, whichever way.

    Wheels scrub, and firmware that holds the faster wheel back slows both.
    """

    name = "turning_loss"
    doc = "forward speed is lost in proportion to the turning rate told"
    source = "seen of iRobot Creates (MRCLAM data sets)"
    robots = ("own",)
    memoryless = True
    parameters = (
        Parameter(
            "loss",
            unit="m",
            nominal=0.0,
            low=0.0,
            high=0.5,
            doc="forward speed lost per turning rate",
            example=0.05,
        ),
    )

    def apply(
        self, signal: ControlSignal, active: np.ndarray, rng: np.random.Generator
    ) -> np.ndarray:
        """The signal with a slower forward speed; it never turns backward.

        Raises:
            UnknownNameError: the robot is not told a forward speed and a turning rate.
        """
        values = signal.values.copy()
        if self.is_nominal:
            return values
        if missing := [name for name in TWIST if name not in signal.channels]:
            raise UnknownNameError("command channel", missing[0], signal.channels)
        speed, rate = (signal.channels.index(name) for name in TWIST)
        told = values[:, speed]
        left = np.maximum(np.abs(told) - self["loss"] * np.abs(values[:, rate]), 0.0)
        values[active, speed] = (np.sign(told) * left)[active]
        return values
