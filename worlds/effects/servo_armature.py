"""Servo armature: inertia of rotor and gears."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoArmature(ServoEffect):
    """Inertia of rotor and gears."""

    name = "servo_armature"
    stage = "body"
    doc = "the rotor's inertia, seen at the output, differs"
    source = "rotor inertia times gear ratio squared; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "inertia",
            unit="kg m2",
            nominal=0.0,
            low=-0.1,
            high=0.5,
            doc="inertia added, negative takes away",
            example=0.02,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("armature", law["armature"] + self["inertia"])
        return {**law, "armature": value}
