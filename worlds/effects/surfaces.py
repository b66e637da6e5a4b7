"""Surfaces of any model: grip, softness and size of what touches; the floor."""

from typing import Any

import mujoco
import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, Choice, factor, strength
from bns.worlds.effects.mass import Inertial
from bns.worlds.effects.parts import ANY, WIDE


class GeomFriction(BodyEffect):
    """A surface slides more, or less, easily than the model says.

    A contact of two geoms of one priority takes the larger of their coefficients. So
    where a floor's is as large, a tyre alone gets a higher priority, and that of their
    contact, scaled; with it the contact is as soft as the tyre says.
    """

    name = "geom_friction"
    source = "MuJoCo documentation, Computation, Contact: the sliding coefficient"
    robots = ANY
    choices = parts.part("geom")
    parameter = factor((0.0, WIDE), "sliding friction over the model's", example=0.5)

    def _write(self, spec: Any) -> None:
        chosen = parts.geoms(spec, self["part"])
        of_all = self["part"] == parts.ALL
        floors = [] if of_all else [*parts.contact_geoms(spec.worldbody)]
        for geom in chosen:
            friction, top = np.array(geom.friction, dtype=float), int(geom.priority)
            over = [floor for floor in floors if int(floor.priority) >= top]
            if over and geom.parent.name != spec.worldbody.name:
                top = max(int(floor.priority) for floor in over)
                rivals = [f for f in (*over, geom) if int(f.priority) == top]
                friction[0] = max(float(other.friction[0]) for other in rivals)
                geom.priority = top + 1
            friction[0] *= self["factor"]
            geom.friction = friction


class GeomRadius(BodyEffect):
    """A wheel, a foot or another round geom is larger, or smaller, than the model says.

    Spheres, capsules, cylinders and ellipsoids are round; capsules and cylinders keep
    their lengths. What the body weighs stays.
    """

    name = "geom_radius"
    source = "bounds assumed"
    robots = ("own",)
    choices = parts.part("geom")
    parameter = factor((0.1, 10.0), "radius over the model's", example=1.05)

    def _write(self, spec: Any) -> None:
        some = parts.geoms(spec, self["part"])
        chosen = [geom for geom in some if geom.type in parts.ROUND_GEOMS]
        if not chosen:
            raise BnsError(
                f"Geom {self['part']!r} is not round: a radius is of a sphere, a "
                "capsule, a cylinder or an ellipsoid."
            )
        weights = {geom.parent.name: geom.parent for geom in chosen}
        held = [(body, Inertial.of(spec, body)) for body in weights.values()]
        for geom in chosen:
            whole = geom.type == mujoco.mjtGeom.mjGEOM_ELLIPSOID
            geom.size[: 3 if whole else 1] *= self["factor"]
        for body, inertial in held:
            inertial.write(body)


def _soften(geom: Any, factor: float) -> None:
    """Let the contacts of a geom take longer, and sink in more."""
    if geom.solref[0] > 0:
        geom.solref[0] *= factor
    else:  # stiffness and damping of a unit mass, each with its sign changed
        geom.solref[:] /= [factor**2, factor]


class GeomCompliance(BodyEffect):
    """A surface is softer, or harder, than the model says.

    A contact of two geoms of one priority takes the mean of what both say. It sinks in
    by about the load's acceleration times the time constant squared.
    """

    name = "geom_compliance"
    source = "MuJoCo documentation, Modeling, Solver parameters; bounds assumed"
    robots = ("own",)
    choices = parts.part("geom")
    parameter = factor((0.1, 20.0), "time constant over the model's", example=2.5)

    def _write(self, spec: Any) -> None:
        for geom in parts.geoms(spec, self["part"]):
            _soften(geom, self["factor"])


SLIDING = Choice(
    "cone",
    ("model", "elliptic"),
    "model",
    "friction as the model's contacts have it, or alike in all directions",
    quiet=True,
)


def set_cone(spec: Any, which: str) -> None:
    """Set which friction contacts have.

    Args:
        spec: the `mujoco.MjSpec`.
        which: "elliptic" = alike in all directions, "pyramidal" = MuJoCo's pyramid of
            four sides; else as the model has it.
    """
    if which == "elliptic":
        spec.option.cone = mujoco.mjtCone.mjCONE_ELLIPTIC
    elif which == "pyramidal":
        spec.option.cone = mujoco.mjtCone.mjCONE_PYRAMIDAL


class FloorFriction(BodyEffect):
    """The robot grips the floor more or less than in the model.

    A contact takes the friction of the geom with the higher priority or, where they are
    equal, the larger of the two: so the robot's and the floor's are both scaled. The
    casters have a priority and a friction of their own and keep them. A pyramid of four
    sides, which does for wheels that roll, holds those that slide by a third more or
    less, depending on how the robot stands in the world; a floor does not.
    """

    name = "floor_friction"
    source = "contact rule: MuJoCo documentation, Computation, Contact; bounds assumed"
    robots = ("wheeled", "legged")
    choices = (SLIDING,)
    parameter = factor(
        (0.01, 3.0),
        "true friction coefficient over the model's; bounds assumed",
        example=0.1,
    )

    def _write(self, spec: Any) -> None:
        for body in (*parts.grounded(spec), spec.worldbody):
            for geom in parts.contact_geoms(body):
                geom.friction[0] *= self["factor"]
        set_cone(spec, self["cone"])


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
    parameter = factor((1.0, 5.0), "time constant over the model's", example=2.5)

    def _write(self, spec: Any) -> None:
        for body in spec.bodies:
            for geom in parts.contact_geoms(body):
                _soften(geom, self["factor"])
