"""Floor friction: the wheels grip the floor more or less than in the model."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter


class FloorFriction(BodyEffect):
    """Sliding friction between wheels or legs and floor is scaled.

    A contact takes the friction of the geom with the higher priority or, where they are
    equal, the larger of the two: so the robot's and the floor's are both scaled. The
    casters have a priority and a friction of their own and keep them.
    """

    name = "floor_friction"
    doc = "the robot grips the floor more or less than in the model"
    source = "contact rule: MuJoCo documentation, Computation, Contact; bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.01,
            high=3.0,
            doc="true friction coefficient over the model's; bounds assumed",
            example=0.1,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for body in (*bodies.grounded(spec), spec.worldbody):
            for geom in bodies.contact_geoms(body):
                geom.friction[0] *= self["factor"]
