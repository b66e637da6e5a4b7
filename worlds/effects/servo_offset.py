"""Servo offset: the encoder's zero is not where the lever hangs."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoOffset(ServoEffect):
    """The encoder's zero is not where the lever hangs."""

    name = "servo_offset"
    stage = "sensor"
    doc = "the encoder reads a constant too much"
    source = "mounting of the horn on its splines; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=-0.5,
            high=0.5,
            doc="reading minus angle, added",
            example=0.05,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("offset", law["offset"] + self["angle"])
        return {**law, "offset": value}
