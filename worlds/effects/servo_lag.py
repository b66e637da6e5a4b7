"""Servo lag: goals are followed through a first-order filter."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoLag(ServoEffect):
    """Goals are followed through a first-order filter."""

    name = "servo_lag"
    stage = "command"
    doc = "goals are followed with a first-order lag"
    source = "first-order model assumed; bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "time_constant",
            unit="s",
            nominal=0.0,
            low=-0.2,
            high=1.0,
            doc="time to 63 % of a step, added",
            example=0.05,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("lag", law["lag"] + self["time_constant"])
        return {**law, "lag": value}
