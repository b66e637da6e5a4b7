"""Servo duty limit: the drive gives a share of the supply at most."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoDutyLimit(ServoEffect):
    """The drive gives a share of the supply at most."""

    name = "servo_duty_limit"
    stage = "actuator"
    doc = "the drive saturates below the full supply"
    source = "overload protection and torque limits of servo firmware act on the duty"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.02,
            high=1.0,
            doc="largest duty over nominal; bounds assumed",
            example=0.3,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("duty_limit", law["duty_limit"] * self["factor"])
        return {**law, "duty_limit": value}
