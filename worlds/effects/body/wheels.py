"""Wheels and their motors: sizes, friction, torque."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.effects import bodies, parts
from bns.worlds.effects.base import BodyEffect, factor, strength
from bns.worlds.effects.common import WHEEL


class AxleLength(BodyEffect):
    """The wheels are further apart or closer than in the model."""

    name = "axle_length"
    source = "published lengths run from 87.4 to 91.6 mm (5 %)"
    parameters = (
        factor(
            (0.7, 1.3),
            "true distance of the wheels over the model's; bounds assumed",
            example=1.1,
        ),
    )

    def _write(self, spec: Any) -> None:
        left, right = (bodies.wheel(spec, side) for side in ("left", "right"))
        growth = (self["factor"] - 1) * (left.pos - right.pos) / 2
        left.pos += growth
        right.pos -= growth


class WheelDiameter(BodyEffect):
    """A wheel is larger or smaller than the model's.

    The wheel's axle is moved up on the body by as much as the radius grows, so that the
    wheel touches the floor where it did: the speed changes, the attitude does not (a
    true robot would lean by 0.13 deg for 1 % of one diameter), and the start pose needs
    no settling. The wheel's mass and inertia stay.
    """

    name = "wheel_diameter"
    source = "published diameters are 41, 42 and 42.4 mm (3 %); level attitude assumed"
    choices = (WHEEL,)
    parameters = (
        factor(
            (0.7, 1.3), "true diameter over the model's; bounds assumed", example=0.95
        ),
    )

    def _write(self, spec: Any) -> None:
        for side in self.wheels():
            body = bodies.wheel(spec, side)
            radius = max(geom.size[0] for geom in bodies.contact_geoms(body))
            for geom in body.geoms:
                geom.size[0] *= self["factor"]
            body.pos[2] += (self["factor"] - 1) * radius


FADES = 1.0  # [rad/s] of a wheel, at which its breakaway is 37 %; 2 cm/s; assumed


class RollingDrag(BodyEffect):
    """A wheel turns against friction.

    friction = torque + viscous |v| + breakaway exp(-(v / FADES)^2) in steady motion.
    """

    name = "rolling_drag"
    source = (
        "Coulomb, viscous and Stribeck model assumed; a wheel's motor gives up to "
        "0.057 N m"
    )
    choices = (WHEEL,)
    resizes = True
    parameters = (
        strength(
            "torque",
            "N m",
            (0.0, 0.057),
            "dry friction; upper bound: the motor's torque (Webots Khepera3)",
            example=0.002,
        ),
        strength(
            "viscous",
            "N m s/rad",
            (0.0, 0.01),
            "friction per wheel speed; bounds assumed",
            example=0.0002,
        ),
        strength(
            "breakaway",
            "N m",
            (0.0, 0.057),
            "dry friction at standstill beyond `torque`; bounds as there",
            example=0.003,
        ),
    )

    def _write(self, spec: Any) -> None:
        for side in self.wheels():
            joint = bodies.joint(spec, side)
            joint.frictionloss += self["torque"]
            joint.damping[0] += self["viscous"]
        if self["breakaway"]:
            held = [bodies.joint(spec, side) for side in self.wheels()]
            parts.stick(spec, held, self["breakaway"], FADES)


LEAST = 1e-9  # of the torque; MuJoCo takes a range of nothing for no limit at all


class TorqueLimit(BodyEffect):
    """A wheel's motor is weaker than in the model."""

    name = "torque_limit"
    source = "nominal 0.057 N m: Webots Khepera3; bounds assumed"
    choices = (WHEEL,)
    parameters = (factor((0.0, 1.0), "largest torque over the model's", example=0.02),)

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: an actuator has no force range to scale.
        """
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
    """A wheel turns about an axle beside its centre.

    At a steady rate w of turning the robot's speed there is w (r + offset sin(a)), a
    being the wheel's angle plus the phase; over whole turns nothing is lost. The
    wheel's mass stays on the axle.
    """

    name = "wheel_eccentricity"
    source = "rolling without slip; bounds assumed"
    choices = (WHEEL,)
    parameters = (
        strength(
            "offset",
            "m",
            (0.0, 0.005),
            "from the axle to the wheel's centre; bounds assumed",
            example=0.001,
        ),
        strength(
            "phase",
            "rad",
            (-np.pi, np.pi),
            "where that is at a trial's start; 0 = ahead, in the sense of rolling",
            example=0.5,
            scales=False,
        ),
    )

    def _write(self, spec: Any) -> None:
        for side in self.wheels():
            axis = np.array(bodies.joint(spec, side).axis)
            ahead = np.array([1.0, 0.0, 0.0])
            down = np.cross(axis / np.linalg.norm(axis), ahead)
            way = np.cos(self["phase"]) * ahead + np.sin(self["phase"]) * down
            for geom in bodies.wheel(spec, side).geoms:
                geom.pos += self["offset"] * way


class CasterDrag(BodyEffect):
    """The casters drag on the floor instead of rolling."""

    name = "caster_drag"
    source = "dry friction; the nominal casters have none; bounds assumed"
    parameters = (
        strength(
            "friction",
            "1",
            (0.0, 1.0),
            "friction coefficient added; bounds assumed",
            example=0.2,
        ),
    )

    def _write(self, spec: Any) -> None:
        """See `BodyEffect.edit`.

        Raises:
            BnsError: the robot rests on its wheels alone.
        """
        base = bodies.base(spec)
        casters = list(bodies.contact_geoms(base))
        if not casters:
            raise BnsError(f"Body {base.name!r} rests on its wheels alone: no caster.")
        for geom in casters:
            geom.condim = max(geom.condim, 3)  # 1 has no friction
            geom.friction[0] += self["friction"]
