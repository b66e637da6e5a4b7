"""The floor: how it grips, how steep and how soft it is."""

from typing import Any

import numpy as np

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, factor, strength


class FloorFriction(BodyEffect):
    """The robot grips the floor more or less than in the model.

    A contact takes the friction of the geom with the higher priority or, where they are
    equal, the larger of the two: so the robot's and the floor's are both scaled. The
    casters have a priority and a friction of their own and keep them.
    """

    name = "floor_friction"
    source = "contact rule: MuJoCo documentation, Computation, Contact; bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        factor(
            (0.01, 3.0),
            "true friction coefficient over the model's; bounds assumed",
            example=0.1,
        ),
    )

    def _write(self, spec: Any) -> None:
        for body in (*bodies.grounded(spec), spec.worldbody):
            for geom in bodies.contact_geoms(body):
                geom.friction[0] *= self["factor"]


class FloorSlope(BodyEffect):
    """The board is not level."""

    name = "floor_slope"
    source = "bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        strength(
            "angle", "rad", (0.0, 0.35), "steepness; 0.35 rad = 20 deg", example=0.1
        ),
        strength(
            "direction",
            "rad",
            (-np.pi, np.pi),
            "where uphill is, counter-clockwise from the board's x axis",
            example=0.5,
            scales=False,
        ),
    )

    def _write(self, spec: Any) -> None:
        pull = float(np.linalg.norm(spec.option.gravity))  # [m/s2]
        angle, uphill = self["angle"], self["direction"]
        spec.option.gravity = [
            -pull * np.sin(angle) * np.cos(uphill),
            -pull * np.sin(angle) * np.sin(uphill),
            -pull * np.cos(angle),
        ]


class FloorCompliance(BodyEffect):
    """The floor is softer than in the model.

    A contact sinks in by about the load's acceleration times the time constant squared:
    0.01 s gives 1 mm under the robot's weight, 0.03 s 9 mm.
    """

    name = "floor_compliance"
    source = "MuJoCo documentation, Modeling, Solver parameters; bounds assumed"
    robots = ("legged",)
    parameters = (factor((1.0, 5.0), "time constant over the model's", example=2.5),)

    def _write(self, spec: Any) -> None:
        for body in spec.bodies:
            for geom in bodies.contact_geoms(body):
                geom.solref[0] *= self["factor"]
