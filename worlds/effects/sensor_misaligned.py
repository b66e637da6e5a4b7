"""Sensor misaligned: it looks aside."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter
from bns.worlds.effects.sensors import SENSOR, columns


class SensorMisaligned(OpticsEffect):
    """A sensor is bent and looks elsewhere; where it sits does not change."""

    name = "sensor_misaligned"
    doc = "a sensor looks aside"
    source = "assumed: a bent sensor"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=-3.2,
            high=3.2,
            doc="added to its heading, counter-clockwise; half a turn",
            example=0.5,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        heading = law["heading"].copy()
        heading[columns(self, sensors)] += self["angle"]
        return {**law, "heading": heading}
