"""Rolling drag: a wheel turns against friction in its bearing or on the floor."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.common import WHEEL


class RollingDrag(BodyEffect):
    """Dry and viscous friction is added to the wheel's joint."""

    name = "rolling_drag"
    doc = "a wheel turns against friction"
    source = "Coulomb and viscous model assumed; a wheel's motor gives up to 0.057 N m"
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "torque",
            unit="N m",
            nominal=0.0,
            low=0.0,
            high=0.057,
            doc="dry friction; upper bound: the motor's torque (Webots Khepera3)",
            example=0.002,
        ),
        Parameter(
            "viscous",
            unit="N m s/rad",
            nominal=0.0,
            low=0.0,
            high=0.01,
            doc="friction per wheel speed; bounds assumed",
            example=0.0002,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for side in self.wheels():
            joint = bodies.joint(spec, side)
            joint.frictionloss += self["torque"]
            joint.damping[0] += self["viscous"]
