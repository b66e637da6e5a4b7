"""Light dimmed: the lamps give less."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter


class LightDimmed(OpticsEffect):
    """The power of all lamps is scaled."""

    name = "light_dimmed"
    doc = "the lamps give less light"
    source = "assumed: a lamp that ages or a low supply"
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=10.0,
            doc="power after over power before; bounds assumed",
            example=0.5,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        return {**law, "lamp_power": law["lamp_power"] * self["factor"]}
