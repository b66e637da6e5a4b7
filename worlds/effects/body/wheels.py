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
        if self.is_nominal:
            return
        left, right = (bodies.wheel(spec, side) for side in ("left", "right"))
        growth = (self["factor"] - 1) * (left.pos - right.pos) / 2
        left.pos += growth
        right.pos -= growth


class WheelDiameter(BodyEffect):
    """The wheel's rolling radius changes; the robot stays level.

    The wheel's axle is moved up on the body by as much as the radius grows, so that the
    wheel touches the floor where it did: the speed changes, the attitude does not (a
    true robot would lean by 0.13 deg for 1 % of one diameter), and the start pose needs
    no settling. The wheel's mass and inertia stay.
    """

    name = "wheel_diameter"
    doc = "a wheel is larger or smaller than the model's"
    source = "published diameters are 41, 42 and 42.4 mm (3 %); level attitude assumed"
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
        if self.is_nominal:
            return
        for side in self.wheels():
            body = bodies.wheel(spec, side)
            radius = max(geom.size[0] for geom in bodies.contact_geoms(body))
            for geom in body.geoms:
                geom.size[0] *= self["factor"]
            body.pos[2] += (self["factor"] - 1) * radius


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
