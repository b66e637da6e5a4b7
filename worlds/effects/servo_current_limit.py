"""Servo current limit: the drive limits its current."""

import numpy as np

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import NO_CURRENT_LIMIT, Law


class ServoCurrentLimit(ServoEffect):
    """The drive limits its current."""

    name = "servo_current_limit"
    stage = "actuator"
    doc = "the motor's current is limited"
    source = "current limits of servo firmware; bounds assumed"
    parameters = (
        Parameter(
            "current",
            unit="A",
            nominal=NO_CURRENT_LIMIT,
            low=0.01,
            high=NO_CURRENT_LIMIT,
            doc="largest current; 1000 is none; bounds assumed",
            example=0.2,
        ),
    )

    def change(self, law: Law) -> Law:
        value = np.minimum(law["current_limit"], self["current"])
        return {**law, "current_limit": value}
