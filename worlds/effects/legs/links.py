"""Parts of legs: their lengths, and what the feet grip."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Choice, factor
from bns.worlds.effects.leg_sets import LEGS_OR_ALL, shins
from bns.worlds.effects.leg_sets import bodies as leg_bodies

PART = Choice("part", ("coxa", "femur", "tibia"), "tibia", "which part of the legs")


class LinkLength(BodyEffect):
    """A part of legs is longer or shorter than in the model."""

    name = "link_length"
    source = "sources give tibias of 130 to 140 mm (numbers.toml); bounds assumed"
    robots = ("legged",)
    choices = (PART, LEGS_OR_ALL)
    parameters = (factor((0.8, 1.25), "length over the model's", example=1.08),)

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
    """The feet of legs grip the floor less."""

    name = "foot_slippery"
    source = "a worn or lost rubber tip; bounds assumed"
    robots = ("legged",)
    choices = (LEGS_OR_ALL,)
    parameters = (
        factor((0.02, 2.0), "friction coefficient over the model's", example=0.2),
    )

    def edit(self, spec: Any) -> None:
        """See `BodyEffect.edit`."""
        if self.is_nominal:
            return
        for body in shins(spec, self["legs"]):
            for geom in bodies.contact_geoms(body):
                geom.friction[0] *= self["factor"]
