"""Servo coulomb: dry friction beside the nominal one."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoCoulomb(ServoEffect):
    """Dry friction beside the nominal one."""

    name = "servo_coulomb"
    stage = "body"
    doc = "dry friction differs"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "torque",
            unit="N m",
            nominal=0.0,
            low=-0.5,
            high=1.0,
            doc="dry friction added, negative takes away",
            example=0.1,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("coulomb", law["coulomb"] + self["torque"])
        return {**law, "coulomb": value}
