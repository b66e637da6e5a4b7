"""Tendons of any model, and joints that are coupled: damping, dry friction, stiffness,
slack, lever arms, ratios."""

from typing import Any

from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, factor, strength
from bns.worlds.effects.joints import PartNumber, added


class _TendonNumber(PartNumber):
    """Something is added to a number of a tendon."""

    choices = parts.part("tendon")
    source = "MuJoCo's tendon model"
    robots = ("own",)

    def _held(self, spec: Any) -> list[Any]:
        return parts.tendons(spec, self["part"])


class TendonDamping(_TendonNumber):
    """A tendon is damped more, or less, than the model says."""

    name, field = "tendon_damping", "damping"
    parameter = added("N s/m", "damping", 1.0, "tendon")


class TendonFriction(_TendonNumber):
    """A tendon rubs in its guides: more, or less, dry friction than the model says."""

    name, field = "tendon_friction", "frictionloss"
    parameter = added("N", "friction loss", 0.5, "tendon")


class TendonStiffness(_TendonNumber):
    """A tendon is held by a spring that the model does not know."""

    name, field = "tendon_stiffness", "stiffness"
    parameter = added("N/m", "stiffness", 50.0, "tendon")


class TendonSlack(BodyEffect):
    """A tendon's spring does not pull within a length: a belt that is not tight.

    It is added to that of the model, half of it on either side.
    """

    name = "tendon_slack"
    choices = parts.part("tendon")
    source = "MuJoCo's tendon springs, which have such a length (springlength)"
    robots = ("own",)
    parameter = strength("slack", "m", (0.0, 1.0), "whole length", example=0.01)

    def _write(self, spec: Any) -> None:
        model = spec.copy().compile()
        for item in parts.tendons(spec, self["part"]):
            low, high = model.tendon_lengthspring[model.tendon(item.name).id]
            half = self["slack"] / 2
            item.springlength = (low - half, high + half)


class TendonArm(BodyEffect):
    """A fixed tendon pulls a joint by another lever arm than the model says.

    A pulley of another radius, or a tendon that runs further from the joint. The part
    is ``TENDON/JOINT``.
    """

    name = "tendon_arm"
    choices = parts.part("lever arm")
    source = "MuJoCo's fixed tendons (coef); bounds assumed"
    robots = ("own",)
    parameter = factor((0.1, 10.0), "lever arm over the model's", example=1.1)

    def _write(self, spec: Any) -> None:
        chosen = set(parts.arms(spec, self["part"]))
        for tendon in [item for item in spec.tendons if parts.fixed(item)]:
            name = tendon.name
            arms = [(wrap.target.name, wrap.coef) for wrap in tendon.path]
            if not chosen & {(name, joint) for joint, _ in arms}:
                continue
            # an arm can not be written: a tendon of the same name takes its place
            tendon.name = f"{name}_before"
            made = spec.add_tendon(name=name)
            for field in _KEPT:
                setattr(made, field, getattr(tendon, field))
            for joint, arm in arms:
                changed = (name, joint) in chosen
                made.wrap_joint(joint, arm * (self["factor"] if changed else 1.0))
            spec.delete(tendon)


_KEPT = (
    "actfrclimited",
    "actfrcrange",
    "armature",
    "damping",
    "frictionloss",
    "limited",
    "margin",
    "range",
    "solimp_friction",
    "solimp_limit",
    "solref_friction",
    "solref_limit",
    "springlength",
    "stiffness",
)


class CouplingRatio(BodyEffect):
    """A joint follows another one by another ratio than the model says.

    A linkage, a belt or gears that an equality of two joints stands for. The part is
    the joint that follows.
    """

    name = "coupling_ratio"
    choices = parts.part("follower")
    source = "MuJoCo's equality of joints (polycoef); bounds assumed"
    robots = ("own",)
    parameter = factor((0.1, 10.0), "ratio over the model's", example=1.1)

    def _write(self, spec: Any) -> None:
        for item in parts.couplings(spec, self["part"]):
            data = item.data.copy()
            data[1] *= self["factor"]
            item.data = data
