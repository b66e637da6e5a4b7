"""Servo stribeck: dry friction that fades with speed."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoStribeck(ServoEffect):
    """Dry friction that fades with speed."""

    name = "servo_stribeck"
    stage = "body"
    doc = "extra dry friction at low speed (Stribeck)"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    parameters = (
        Parameter(
            "torque",
            unit="N m",
            nominal=0.0,
            low=-0.5,
            high=1.0,
            doc="friction added at speed 0, negative takes away",
            example=0.1,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("stribeck", law["stribeck"] + self["torque"])
        return {**law, "stribeck": value}
