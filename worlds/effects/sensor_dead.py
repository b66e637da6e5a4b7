"""Sensor dead: it answers to a share of the light, or to none."""

from collections.abc import Mapping

import numpy as np

from bns.worlds.effects.base import OpticsEffect, Parameter
from bns.worlds.effects.sensors import SENSOR, columns


class SensorDead(OpticsEffect):
    """A share of the light on a sensor is lost; what is left is noise in the dark."""

    name = "sensor_dead"
    doc = "a sensor answers to a share of the light or to none"
    source = "assumed: a covered, dirty or broken phototransistor"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "loss",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="share of its light that is lost; 1 = dead",
            example=1.0,
        ),
    )

    def change(
        self, law: Mapping[str, np.ndarray], sensors: tuple[str, ...]
    ) -> dict[str, np.ndarray]:
        gain = law["sensitivity"].copy()
        gain[columns(self, sensors)] *= 1 - self["loss"]
        return {**law, "sensitivity": gain}
