"""Tendons of any model: damping, dry friction, stiffness, slack."""

from typing import Any

from bns.worlds.effects import parts
from bns.worlds.effects.base import BodyEffect, strength
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
