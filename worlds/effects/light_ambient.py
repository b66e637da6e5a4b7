"""Ambient light: the whole room is brighter."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter


class LightAmbient(OpticsEffect):
    """Light is added that falls on all sensors alike."""

    name = "light_ambient"
    doc = "the room is brighter everywhere"
    source = "assumed: a window or the room's lamps"
    parameters = (
        Parameter(
            "added",
            unit="W/m2",
            nominal=0.0,
            low=0.0,
            high=100.0,
            doc="irradiance added; bounds assumed",
            example=0.3,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        return {**law, "ambient": law["ambient"] + self["added"]}
