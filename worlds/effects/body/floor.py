"""The floor: how it grips, how steep and how soft it is."""

from typing import Any

import numpy as np

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
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for body in (*bodies.grounded(spec), spec.worldbody):
            for geom in bodies.contact_geoms(body):
                geom.friction[0] *= self["factor"]


class FloorSlope(BodyEffect):
    """Gravity is tilted in the board's frame, which is what a sloping board feels."""

    name = "floor_slope"
    doc = "the board is not level"
    source = "bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.35,
            doc="steepness; 0.35 rad = 20 deg",
            example=0.1,
        ),
        Parameter(
            "direction",
            unit="rad",
            nominal=0.0,
            low=-np.pi,
            high=np.pi,
            doc="where uphill is, counter-clockwise from the board's x axis",
            example=0.5,
            scales=False,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        pull = float(np.linalg.norm(spec.option.gravity))  # [m/s2]
        angle, uphill = self["angle"], self["direction"]
        spec.option.gravity = [
            -pull * np.sin(angle) * np.cos(uphill),
            -pull * np.sin(angle) * np.sin(uphill),
            -pull * np.cos(angle),
        ]


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
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for body in spec.bodies:
            for geom in bodies.contact_geoms(body):
                geom.solref[0] *= self["factor"]
