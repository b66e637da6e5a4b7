"""Servo torque constant: the motor's torque per current differs."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoTorqueConstant(ServoEffect):
    """The motor's torque per current differs."""

    name = "servo_torque_constant"
    stage = "actuator"
    doc = "the torque constant differs; the back-EMF follows it"
    source = "motor equation: torque kt i, back-EMF kt w"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.3,
            high=3.0,
            doc="torque constant over nominal; bounds assumed",
            example=0.8,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("torque_constant", law["torque_constant"] * self["factor"])
        return {**law, "torque_constant": value}
