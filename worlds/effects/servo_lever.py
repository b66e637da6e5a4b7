"""Servo lever: the mass sits nearer or further out."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoLever(ServoEffect):
    """The mass sits nearer or further out."""

    name = "servo_lever"
    stage = "body"
    doc = "the lever's length differs from what is told"
    source = "the whole lever is scaled, its mass stays"
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.25,
            high=4.0,
            doc="length over length told; bounds assumed",
            example=1.2,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("lever", law["lever"] * self["factor"])
        return {**law, "lever": value}
