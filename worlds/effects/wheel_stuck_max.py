"""Wheel stuck at its maximum speed."""

from bns.worlds.effects.common import MAXIMUM_SPEED
from bns.worlds.effects.stuck import BLEND, StuckWheel, stuck_speed


class WheelStuckMax(StuckWheel):
    """A wheel is only able to turn at the maximum speed."""

    name = "wheel_stuck_max"
    doc = "a wheel turns at the maximum speed whatever it is told"
    source = "thesis 6.2.1; maximum of 17,500 speed units: the lab's controller files"
    parameters = (
        BLEND,
        stuck_speed(
            MAXIMUM_SPEED,
            "maximum speed; 17,500 units by the lab's files (the drive reaches 48,000)",
        ),
    )
