"""Foot slippery: some feet grip the floor less."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.effects.legs import LEGS_OR_ALL, shins


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
        if self.is_nominal:
            return
        for body in shins(spec, self["legs"]):
            for geom in bodies.contact_geoms(body):
                geom.friction[0] *= self["factor"]
