"""Servo voltage: the supply differs."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoVoltage(ServoEffect):
    """The supply differs."""

    name = "servo_voltage"
    stage = "actuator"
    doc = "the supply voltage differs from what is told"
    source = "duty times voltage drives the motor"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.3,
            high=3.0,
            doc="voltage over voltage told; bounds assumed",
            example=0.8,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("voltage", law["voltage"] * self["factor"])
        return {**law, "voltage": value}
