"""Axle length: the wheels are further apart or closer than in the model."""

from typing import Any

from bns.worlds.effects import bodies
from bns.worlds.effects.base import BodyEffect, Parameter


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
