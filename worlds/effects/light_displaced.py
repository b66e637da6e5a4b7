"""Light displaced: the lamps stand elsewhere."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter


class LightDisplaced(OpticsEffect):
    """All lamps are moved; the safety boundary and the task stay where they were."""

    name = "light_displaced"
    doc = "the light stands elsewhere"
    source = "assumed: a lamp that was pushed"
    parameters = (
        Parameter(
            "x",
            unit="m",
            nominal=0.0,
            low=-3.0,
            high=3.0,
            doc="shift along x; bounds assumed",
            example=0.2,
        ),
        Parameter(
            "y",
            unit="m",
            nominal=0.0,
            low=-3.0,
            high=3.0,
            doc="shift along y; bounds assumed",
            example=-0.1,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        shift = np.array([self["x"], self["y"], 0.0])
        return {**law, "lamp_position": law["lamp_position"] + shift}
