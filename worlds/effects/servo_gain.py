"""Servo gain: the firmware's proportional gain differs."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoGain(ServoEffect):
    """The firmware's proportional gain differs."""

    name = "servo_gain"
    stage = "actuator"
    doc = "the position gain differs from what is told"
    source = "the gain is a register of the servo that is easily misread"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.05,
            high=20.0,
            doc="gain over gain told; bounds assumed",
            example=0.7,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("gain", law["gain"] * self["factor"])
        return {**law, "gain": value}
