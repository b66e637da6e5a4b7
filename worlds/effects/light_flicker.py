"""Light flicker: the lamps' power comes and goes."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter


class LightFlicker(OpticsEffect):
    """A share of the power of all lamps goes and comes as a sine does."""

    name = "light_flicker"
    doc = "the lamps flicker"
    source = "assumed: a lamp on mains, or a loose contact"
    parameters = (
        Parameter(
            "depth",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of the power that goes",
            example=0.5,
        ),
        Parameter(
            "frequency",
            unit="Hz",
            nominal=1.3,
            low=0.001,
            high=1000.0,
            doc="of the flicker; bounds assumed",
            example=1.3,
            scales=False,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        lamps = np.ones_like(law["lamp_power"])
        if self.is_nominal:
            return dict(law)
        return {
            **law,
            "flicker_depth": self["depth"] * lamps,
            "flicker_frequency": self["frequency"] * lamps,
        }
