"""Legs: joints and parts, and whole legs that are missing, limp, or held up."""

from typing import Any

import numpy as np

from bns.models import legs
from bns.models.legs import LEGS, PARTS
from bns.worlds.effects.base import (
    BodyEffect,
    Choice,
    CommandEffect,
    ControlSignal,
    factor,
    strength,
)
from bns.worlds.effects.leg_sets import JOINT, LEG_SET, LEGS_OR_ALL, chosen, read, shins
from bns.worlds.effects.leg_sets import bodies as leg_bodies
from bns.worlds.effects.parts import contact_geoms, loosen
from bns.worlds.physics import servo_law


class JointWeak(BodyEffect):
    """The servo of a joint gives a share of its torque."""

    name = "joint_weak"
    source = "worn motor or gears; bounds assumed"
    robots = ("legged",)
    choices = (JOINT,)
    parameter = factor((0.02, 1.0), "torque left over torque before", example=0.4)

    def _write(self, spec: Any) -> None:
        for actuator in chosen(spec, self["joint"]):
            law, powered = servo_law.read(actuator)
            weak = {name: law[name] * self["factor"] for name in ("gain", "duty_limit")}
            servo_law.write(spec, actuator, {**law, **weak}, powered)


SLACK = 1e-4  # [rad] by which the stops stay apart, as MuJoCo needs


class JointLocked(BodyEffect):
    """A joint is seized at an angle, or moves in a part of its range.

    A trial starts with the joint there; setting in within a trial forces it there.
    """

    name = "joint_locked"
    source = "bounds: end stops of the maker's robot"
    robots = ("legged",)
    choices = (JOINT,)
    parameters = (
        strength(
            "loss",
            "1",
            (0.0, 1.0),
            "share of the range that is lost; 1 = locked",
            example=1.0,
        ),
        strength(
            "angle",
            "rad",
            (-1.5, 1.5),
            "where it stands, from half-way; beyond an end stop: there",
            example=0.3,
            scales=False,
        ),
    )

    def _write(self, spec: Any) -> None:
        joint = spec.joint(self["joint"])
        low, high = joint.range
        angle, loss = min(max(self["angle"], low), high), self["loss"]
        joint.range = [
            low + loss * (angle - low) - SLACK,
            high + loss * (angle - high) + SLACK,
        ]


ARMATURE = 1e-4  # [kg m2] of the play's joint, so that it can be computed; assumed
DAMPING = 1e-3  # [N m s/rad] in the play; assumed


class LooseHorn(BodyEffect):
    """A loose horn: play between a servo and the part that it moves.

    The servo reports its own shaft, not what the horn does.
    """

    name = "loose_horn"
    source = "backlash as a joint of its own with stops; bounds assumed"
    robots = ("legged",)
    choices = (JOINT,)
    resizes = True
    parameter = strength("angle", "rad", (0.0, 0.6), "full play", example=0.15)

    def _write(self, spec: Any) -> None:
        joint = spec.joint(self["joint"])
        loosen(spec, joint, self["angle"], (ARMATURE, DAMPING))


PART = Choice("part", ("coxa", "femur", "tibia"), "tibia", "which part of the legs")


class LinkLength(BodyEffect):
    """A part of legs is longer or shorter than in the model."""

    name = "link_length"
    source = "sources give tibias of 130 to 140 mm (numbers.toml); bounds assumed"
    robots = ("legged",)
    choices = (PART, LEGS_OR_ALL)
    parameter = factor((0.8, 1.25), "length over the model's", example=1.08)

    def _write(self, spec: Any) -> None:
        factor = self["factor"]
        for body in leg_bodies(spec, self["legs"], self["part"]):
            body.ipos[0] *= factor
            for item in (*body.geoms, *body.sites, *body.bodies):
                item.pos[0] *= factor
            for geom in body.geoms:
                geom.fromto[0] *= factor
                geom.fromto[3] *= factor


class FootSlippery(BodyEffect):
    """The feet of legs grip the floor less."""

    name = "foot_slippery"
    source = "a worn or lost rubber tip; bounds assumed"
    robots = ("legged",)
    choices = (LEGS_OR_ALL,)
    parameter = factor(
        (0.02, 2.0), "friction coefficient over the model's", example=0.2
    )

    def _write(self, spec: Any) -> None:
        for body in shins(spec, self["legs"]):
            for geom in contact_geoms(body):
                geom.friction[0] *= self["factor"]


LEFT = 1e-4  # share of mass and inertia that stays, so that the joints can be computed


class LegMissing(BodyEffect):
    """Legs have come off."""

    name = "leg_missing"
    source = "masses of the model taken away; bounds by definition"
    robots = ("legged",)
    choices = (LEG_SET,)
    resizes = True  # its pairs of geoms go
    parameter = strength(
        "loss", "1", (0.0, 1.0), "whether it is off", example=1.0, integer=True
    )

    def _write(self, spec: Any) -> None:
        gone = set()
        for part in PARTS:
            for body in leg_bodies(spec, self["legs"], part):
                body.mass *= LEFT
                body.inertia = [LEFT * value for value in body.inertia]
                for geom in contact_geoms(body):
                    geom.contype, geom.conaffinity = 0, 0
                    gone.add(geom.name)
        for pair in list(spec.pairs):
            if gone & {pair.geomname1, pair.geomname2}:
                spec.delete(pair)

    def lost(self) -> frozenset[int]:
        """See `Effect.lost`."""
        return frozenset(read(self["legs"]) if self["loss"] else ())


class LegLimp(BodyEffect):
    """The servos of legs give no torque."""

    name = "leg_limp"
    source = "an unpowered bridge is open; friction of the gears stays"
    robots = ("legged",)
    choices = (LEG_SET,)
    parameter = strength(
        "loss", "1", (0.0, 1.0), "share of the motor that is off", example=1.0
    )

    def _write(self, spec: Any) -> None:
        for leg in read(self["legs"]):
            for actuator in chosen(spec, LEGS[leg - 1]):
                law, powered = servo_law.read(actuator)
                powered *= 1.0 - self["loss"]
                servo_law.write(spec, actuator, law, powered)

    def lost(self) -> frozenset[int]:
        """See `Effect.lost`."""
        return frozenset(read(self["legs"]) if self["loss"] > 0.5 else ())


RAISED = {"coxa": 0.0, "femur": 1.3, "tibia": 0.0}  # [rad] foot 0.1 m above the hip


class LegRaised(CommandEffect):
    """Legs are held up where they cannot touch the ground."""

    name = "leg_raised"
    source = "thesis 7.2.2: commands altered to raise the leg; the pose is assumed"
    robots = ("legged",)
    choices = (LEG_SET,)
    parameter = strength(
        "blend",
        "1",
        (0.0, 1.0),
        "from the pose told (0) to the raised pose (1)",
        example=1.0,
    )

    def _change(self, signal: ControlSignal, active: np.ndarray) -> None:
        values = signal.values
        for leg in read(self["legs"]):
            for part in legs.parts(signal.channels):
                column = signal.column(f"{LEGS[leg - 1]}_{part}")
                told = values[active, column]
                values[active, column] += self["blend"] * (RAISED[part] - told)

    def lost(self) -> frozenset[int]:
        """See `Effect.lost`."""
        return frozenset(read(self["legs"]) if self["blend"] > 0.5 else ())
