"""Servo backlash: play between gears and lever."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoBacklash(ServoEffect):
    """Play between gears and lever."""

    name = "servo_backlash"
    stage = "body"
    doc = "play between gears and lever"
    source = "two inertias that meet without a bounce; bounds assumed"
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.3,
            doc="full play added",
            example=0.02,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("backlash", law["backlash"] + self["angle"])
        return {**law, "backlash": value}
