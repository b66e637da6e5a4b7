"""Servo delay: goals take effect later."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoDelay(ServoEffect):
    """Goals take effect later."""

    name = "servo_delay"
    stage = "command"
    doc = "goals take effect later than nominal"
    source = "time on the bus and in the firmware; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "delay",
            unit="s",
            nominal=0.0,
            low=-0.1,
            high=0.5,
            doc="time added, negative takes away; never below none",
            example=0.05,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("delay", law["delay"] + self["delay"])
        return {**law, "delay": value}
