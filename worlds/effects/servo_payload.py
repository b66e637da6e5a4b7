"""Servo payload: the mass at the end of the lever differs."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoPayload(ServoEffect):
    """The mass at the end of the lever differs."""

    name = "servo_payload"
    stage = "body"
    doc = "the lifted mass differs from what is told"
    source = "a point mass at the end of the lever"
    parameters = (
        Parameter(
            "mass",
            unit="kg",
            nominal=0.0,
            low=-2.0,
            high=5.0,
            doc="mass added, negative takes away; bounds assumed",
            example=0.2,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("mass", law["mass"] + self["mass"])
        return {**law, "mass": value}
