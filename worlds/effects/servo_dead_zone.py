"""Servo dead zone: the motor rests while the error is small."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoDeadZone(ServoEffect):
    """The motor rests while the error is small."""

    name = "servo_dead_zone"
    stage = "actuator"
    doc = "the motor rests while the error is small"
    source = "compliance margin or dead zone register of servo firmware; bounds assumed"
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.3,
            doc="error up to which it rests, added",
            example=0.02,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("dead_zone", law["dead_zone"] + self["angle"])
        return {**law, "dead_zone": value}
