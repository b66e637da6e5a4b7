"""Link length: a part of some legs is longer or shorter than in the model."""

from typing import Any

from bns.worlds.effects.base import BodyEffect, Choice, Parameter
from bns.worlds.effects.legs import LEGS_OR_ALL, bodies

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
        if self.is_nominal:
            return
        factor = self["factor"]
        for body in bodies(spec, self["legs"], self["part"]):
            body.ipos[0] *= factor
            for item in (*body.geoms, *body.sites, *body.bodies):
                item.pos[0] *= factor
            for geom in body.geoms:
                geom.fromto[0] *= factor
                geom.fromto[3] *= factor
