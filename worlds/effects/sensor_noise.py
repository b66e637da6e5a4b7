"""Sensor noise: readings scatter more."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter
from bns.worlds.effects.sensors import SENSOR, columns


class SensorNoise(OpticsEffect):
    """The noise of a sensor is multiplied; a saturated reading still repeats itself."""

    name = "sensor_noise"
    doc = "a sensor's readings scatter more"
    source = "thesis 6.2.1, 6.3.1: the noise found is doubled; what was found is silent"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=20.0,
            doc="noise after over noise before; bounds assumed",
            example=2.0,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        noise = law["noise"].copy()
        noise[columns(self, sensors)] *= self["factor"]
        return {**law, "noise": noise}
