"""Floor slope: the board is not level."""

from typing import Any

import numpy as np

from bns.worlds.effects.base import BodyEffect, Parameter


class FloorSlope(BodyEffect):
    """Gravity is tilted in the board's frame, which is what a sloping board feels."""

    name = "floor_slope"
    doc = "the board is not level"
    source = "bounds assumed"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.35,
            doc="steepness; 0.35 rad = 20 deg",
            example=0.1,
        ),
        Parameter(
            "direction",
            unit="rad",
            nominal=0.0,
            low=-np.pi,
            high=np.pi,
            doc="where uphill is, counter-clockwise from the board's x axis",
            example=0.5,
            scales=False,
        ),
    )

    def edit(self, spec: Any) -> None:
        if self.is_nominal:
            return
        pull = float(np.linalg.norm(spec.option.gravity))  # [m/s2]
        angle, uphill = self["angle"], self["direction"]
        spec.option.gravity = [
            -pull * np.sin(angle) * np.cos(uphill),
            -pull * np.sin(angle) * np.sin(uphill),
            -pull * np.cos(angle),
        ]
