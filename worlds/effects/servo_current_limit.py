"""Servo current limit: the drive limits its current."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.servo_law import Law, clipped


class ServoCurrentLimit(ServoEffect):
    """The drive limits its current."""

    name = "servo_current_limit"
    stage = "actuator"
    doc = "the motor's current is limited"
    source = "current limits of servo firmware; bounds assumed"
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0001,
            high=1.0,
            doc="largest current over nominal (1000 A is none)",
            example=0.0005,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("current_limit", law["current_limit"] * self["factor"])
        return {**law, "current_limit": value}
