"""Servo load friction: friction that grows with the torque that the gears carry."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoLoadFriction(ServoEffect):
    """Friction that grows with the torque that the gears carry."""

    name = "servo_load_friction"
    stage = "body"
    doc = "gear friction in proportion to the load"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "coefficient",
            unit="1",
            nominal=0.0,
            low=-0.5,
            high=0.8,
            doc="friction per torque added, negative takes away",
            example=0.1,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("load_friction", law["load_friction"] + self["coefficient"])
        return {**law, "load_friction": value}
