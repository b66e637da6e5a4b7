"""Light shadow: behind something the lamps are dimmer."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter


class LightShadow(OpticsEffect):
    """A sector seen from each lamp gets a share of its light less."""

    name = "light_shadow"
    doc = "a part of the arena lies in shadow"
    source = "assumed: somebody or something stands beside the lamp"
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of the light that is kept off",
            example=0.8,
        ),
        Parameter(
            "azimuth",
            unit="rad",
            nominal=0.0,
            low=-3.2,
            high=3.2,
            doc="middle of the sector, seen from the lamp; half a turn",
            example=0.0,
            scales=False,
        ),
        Parameter(
            "width",
            unit="rad",
            nominal=1.0,
            low=0.001,
            high=6.2832,
            doc="of the sector; up to a full turn",
            example=1.0,
            scales=False,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        if self.is_nominal:
            return dict(law)
        return {
            **law,
            "shadow_azimuth": np.array(self["azimuth"]),
            "shadow_width": np.array(self["width"]),
            "shadow_transmission": np.array(1 - self["loss"]),
        }
