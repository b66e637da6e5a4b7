"""Servo viscous: friction that grows with speed."""

from bns.worlds.effects.base import Parameter, ServoEffect
from bns.worlds.physics.servo_law import Law, clipped


class ServoViscous(ServoEffect):
    """Friction that grows with speed."""

    name = "servo_viscous"
    stage = "body"
    doc = "viscous friction differs"
    source = "BAM (Duclusaud et al., ICRA 2025); bounds assumed"
    robots = ("servo", "legged")
    parameters = (
        Parameter(
            "coefficient",
            unit="N m s/rad",
            nominal=0.0,
            low=-0.5,
            high=2.0,
            doc="viscous friction added, negative takes away",
            example=0.1,
        ),
    )

    def change(self, law: Law) -> Law:
        value = clipped("viscous", law["viscous"] + self["coefficient"])
        return {**law, "viscous": value}
