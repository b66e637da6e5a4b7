"""Commands of robots told a forward speed and a turning rate."""

import numpy as np

from bns.errors import UnknownNameError
from bns.worlds.effects.base import CommandEffect, ControlSignal, strength

TWIST = ("forward_speed", "turning_rate")
"""names of the two channels"""


class TurningLoss(CommandEffect):
    """Forward speed is lost while the robot turns, whichever way.

    Wheels scrub, and firmware that holds the faster wheel back slows both.
    """

    name = "turning_loss"
    source = "seen of iRobot Creates (MRCLAM data sets); bounds assumed"
    robots = ("own",)
    memoryless = True
    parameters = (
        strength(
            "loss",
            "m",
            (0.0, 0.5),
            "forward speed lost over turning rate told",
            example=0.05,
        ),
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        """See `CommandEffect.apply`; forward speed never changes its sign.

        Raises:
            UnknownNameError: the robot is not told a forward speed and a turning rate.
        """
        if missing := [name for name in TWIST if name not in signal.channels]:
            raise UnknownNameError("command channel", missing[0], signal.channels)
        speed, rate = (signal.channels.index(name) for name in TWIST)
        told, turning = signal.values[:, speed], np.abs(signal.values[:, rate])
        left = np.maximum(np.abs(told) - self["loss"] * turning, 0.0)
        told[active] = (np.sign(told) * left)[active]
