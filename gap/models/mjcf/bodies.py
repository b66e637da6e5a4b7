"""Effects on the parts of any MJCF model: joints, bodies, actuators, geoms."""

from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.gap.models.mjcf.effect_target import PART, number
from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect


class _Joint(BodyEffect):
    """Something is added to a number of a joint."""

    robots = ("own",)
    choices = PART
    source = "MuJoCo's joint model"
    field = ""

    def edit(self, spec: Any) -> None:
        joint = _found(spec.joint(self["part"]), "joint", self["part"])
        value = np.array(getattr(joint, self.field), dtype=float)
        flat = value.reshape(-1)
        flat[0] = max(flat[0] + self["added"], 0.0)
        setattr(joint, self.field, value if value.ndim else float(value))


class JointDamping(_Joint):
    """A joint resists motion in proportion to its speed."""

    name, field = "joint_damping", "damping"
    doc = "a joint is damped more, or less, than the model says"
    parameters = number("added", "SI", 0.0, "added to the joint's damping")


class JointFriction(_Joint):
    """A joint resists motion by a constant force."""

    name, field = "joint_friction", "frictionloss"
    doc = "a joint has more, or less, dry friction than the model says"
    parameters = number("added", "SI", 0.0, "added to the joint's friction loss")


class JointArmature(_Joint):
    """Inertia of a rotor that the joint turns."""

    name, field = "joint_armature", "armature"
    doc = "a joint carries more, or less, rotor inertia than the model says"
    parameters = number("added", "SI", 0.0, "added to the joint's armature")


class JointStiffness(_Joint):
    """A spring at a joint."""

    name, field = "joint_stiffness", "stiffness"
    doc = "a joint is held by a spring that the model does not know"
    parameters = number("added", "SI", 0.0, "added to the joint's stiffness")


class BodyMass(BodyEffect):
    """A mass added to a body at its centre of mass; its inertia stays."""

    name = "body_mass"
    doc = "a body is heavier, or lighter, than the model says"
    source = "rigid-body mechanics; a point mass at the centre of mass is assumed"
    robots = ("own",)
    choices = PART
    parameters = number("added", "kg", 0.0, "added mass")

    def edit(self, spec: Any) -> None:
        body = _found(spec.body(self["part"]), "body", self["part"])
        inertial = bodies.Inertial.of(spec, body)
        added = max(self["added"], -0.99 * inertial.mass)
        inertial.plus_point(added, inertial.centre).write(body)


class ActuatorGain(BodyEffect):
    """An actuator gives a share of the force that it should."""

    name = "actuator_gain"
    doc = "an actuator is weaker, or stronger, than the model says"
    source = "MuJoCo's actuator model: gain and bias scaled together"
    robots = ("own",)
    choices = PART
    parameters = number("factor", "1", 1.0, "force over the model's")

    def edit(self, spec: Any) -> None:
        item = _found(spec.actuator(self["part"]), "actuator", self["part"])
        item.gainprm = np.asarray(item.gainprm) * self["factor"]
        item.biasprm = np.asarray(item.biasprm) * self["factor"]


class GeomFriction(BodyEffect):
    """A surface is more slippery, or less."""

    name = "geom_friction"
    doc = "a surface slides more, or less, easily than the model says"
    source = "MuJoCo's contact model: the sliding coefficient is scaled"
    robots = ("own",)
    choices = PART
    parameters = number("factor", "1", 1.0, "sliding friction over the model's")

    def edit(self, spec: Any) -> None:
        geom = _found(spec.geom(self["part"]), "geom", self["part"])
        friction = np.array(geom.friction, dtype=float)
        friction[0] *= self["factor"]
        geom.friction = friction


def _found(item: Any, kind: str, name: str) -> Any:
    if item is None:
        raise BnsError(f"The model has no {kind} {name!r}.")
    return item
