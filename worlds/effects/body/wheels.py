"""Wheels and their motors: sizes, friction, torque."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.common import WHEEL


class AxleLength(BodyEffect):
    """Both wheels are moved along the axle, away from its middle or towards it."""

    name = "axle_length"
    doc = "the wheels are further apart or closer than in the model"
    source = "published lengths run from 87.4 to 91.6 mm (5 %)"
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.7,
            high=1.3,
            doc="true distance of the wheels over the model's; bounds assumed",
            example=1.1,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        left, right = (bodies.wheel(spec, side) for side in ("left", "right"))
        growth = (self["factor"] - 1) * (left.pos - right.pos) / 2
        left.pos += growth
        right.pos -= growth


class WheelDiameter(BodyEffect):
    """The wheel's rolling radius changes; its axle stays where it is on the body.

    So the robot leans (by 0.13 deg for 1 % of one diameter), and with two worn wheels
    comes down on its casters, which take weight off the wheels. The wheel's mass and
    inertia stay.
    """

    name = "wheel_diameter"
    doc = "a wheel is larger or smaller than the model's"
    source = "published diameters are 41, 42 and 42.4 mm (3 %)"
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.7,
            high=1.3,
            doc="true diameter over the model's; bounds assumed",
            example=0.95,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for side in self.wheels():
            body = bodies.wheel(spec, side)
            for geom in body.geoms:
                geom.size[0] *= self["factor"]


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
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for side in self.wheels():
            joint = bodies.joint(spec, side)
            joint.frictionloss += self["torque"]
            joint.damping[0] += self["viscous"]


LEAST = 1e-9  # of the torque; MuJoCo takes a range of nothing for no limit at all


class TorqueLimit(BodyEffect):
    """The largest torque of a wheel's motor is scaled."""

    name = "torque_limit"
    doc = "a wheel's motor is weaker than in the model"
    source = "nominal 0.057 N m: Webots Khepera3; bounds assumed"
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=1.0,
            doc="largest torque over the model's",
            example=0.02,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no force range to scale.
        """
        if self.is_nominal:
            return
        for side in self.wheels():
            motor = bodies.actuator(spec, side)
            if not motor.forcerange.any():
                raise BnsError(
                    f"Actuator {motor.name!r} has no force range to scale: give it a "
                    "`forcerange` in the model."
                )
            share = max(self["factor"], LEAST)
            motor.forcerange = np.asarray(motor.forcerange) * share


class WheelEccentricity(BodyEffect):
    """A wheel turns about an axle beside its centre: it drives by fits and starts.

    At a steady rate w of turning the robot's speed there is w (r + offset sin(a)), a
    being the wheel's angle plus the phase; over whole turns nothing is lost. The
    wheel's mass stays on the axle.
    """

    name = "wheel_eccentricity"
    doc = "a wheel turns about an axle beside its centre"
    source = "rolling without slip; bounds assumed"
    choices = (WHEEL,)
    parameters = (
        Parameter(
            "offset",
            unit="m",
            nominal=0.0,
            low=0.0,
            high=0.005,
            doc="from the axle to the wheel's centre; bounds assumed",
            example=0.001,
        ),
        Parameter(
            "phase",
            unit="rad",
            nominal=0.0,
            low=-np.pi,
            high=np.pi,
            doc="where that is at a trial's start; 0 = ahead, in the sense of rolling",
            example=0.5,
            scales=False,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for side in self.wheels():
            axis = np.array(bodies.joint(spec, side).axis)
            ahead = np.array([1.0, 0.0, 0.0])
            down = np.cross(axis / np.linalg.norm(axis), ahead)
            way = np.cos(self["phase"]) * ahead + np.sin(self["phase"]) * down
            for geom in bodies.wheel(spec, side).geoms:
                geom.pos += self["offset"] * way


class CasterDrag(BodyEffect):
    """What the body rests on beside its wheels rubs on the floor."""

    name = "caster_drag"
    doc = "the casters drag on the floor instead of rolling"
    source = "dry friction; the nominal casters have none; bounds assumed"
    parameters = (
        Parameter(
            "friction",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="friction coefficient added; bounds assumed",
            example=0.2,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: the robot rests on its wheels alone.
        """
        if self.is_nominal:
            return
        base = bodies.base(spec)
        casters = list(bodies.contact_geoms(base))
        if not casters:
            raise BnsError(f"Body {base.name!r} rests on its wheels alone: no caster.")
        for geom in casters:
            geom.condim = max(geom.condim, 3)  # 1 has no friction
            geom.friction[0] += self["friction"]
