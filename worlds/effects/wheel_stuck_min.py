"""Wheel stuck at its minimum speed."""

from bns.worlds.effects.common import MINIMUM_SPEED
from bns.worlds.effects.stuck import BLEND, StuckWheel, stuck_speed


class WheelStuckMin(StuckWheel):
    """A wheel is only able to turn at the minimum speed."""

    name = "wheel_stuck_min"
    doc = "a wheel turns at the minimum speed whatever it is told"
    source = "thesis 6.2.1; minimum of 8,000 speed units: the lab's controller files"
    parameters = (
        BLEND,
        stuck_speed(
            MINIMUM_SPEED,
            "minimum speed; 8,000 units by the lab's files (0 is the other reading)",
        ),
    )
