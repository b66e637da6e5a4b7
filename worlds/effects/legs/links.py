"""Parts of legs: their lengths, and what the feet grip."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Choice, Parameter
from bns.worlds.effects.leg_sets import LEGS_OR_ALL, shins
from bns.worlds.effects.leg_sets import bodies as leg_bodies

PART = Choice("part", ("coxa", "femur", "tibia"), "tibia", "which part of the legs")


class LinkLength(BodyEffect):
    """Everything of the part is stretched along the leg; its mass stays."""

    name = "link_length"
    doc = "a part of legs is longer or shorter than in the model"
    source = "sources give tibias of 130 to 140 mm (numbers.toml); bounds assumed"
    robots = ("legged",)
    choices = (PART, LEGS_OR_ALL)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.8,
            high=1.25,
            doc="length over the model's",
            example=1.08,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        factor = self["factor"]
        for body in leg_bodies(spec, self["legs"], self["part"]):
            body.ipos[0] *= factor
            for item in (*body.geoms, *body.sites, *body.bodies):
                item.pos[0] *= factor
            for geom in body.geoms:
                geom.fromto[0] *= factor
                geom.fromto[3] *= factor


class FootSlippery(BodyEffect):
    """Sliding friction of foot and shin is scaled; it holds, not the floor's."""

    name = "foot_slippery"
    doc = "the feet of legs grip the floor less"
    source = "a worn or lost rubber tip; bounds assumed"
    robots = ("legged",)
    choices = (LEGS_OR_ALL,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.02,
            high=2.0,
            doc="friction coefficient over the model's",
            example=0.2,
        ),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for body in shins(spec, self["legs"]):
            for geom in bodies.contact_geoms(body):
                geom.friction[0] *= self["factor"]
