"""Floor compliance: the floor gives way under the feet."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter


class FloorCompliance(BodyEffect):
    """The time constant of the robot's contacts is longer, as on a mat or carpet.

    A contact sinks in by about the load's acceleration times the time constant squared:
    0.01 s gives 1 mm under the robot's weight, 0.03 s 9 mm.
    """

    name = "floor_compliance"
    doc = "the floor is softer than in the model"
    source = "MuJoCo documentation, Modeling, Solver parameters; bounds assumed"
    robots = ("legged",)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=1.0,
            high=5.0,
            doc="time constant over the model's",
            example=2.5,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        for body in spec.bodies:
            for geom in bodies.contact_geoms(body):
                geom.solref[0] *= self["factor"]
