"""Sensor gain: readings are scaled."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.sensors import SENSOR, columns, limited


class SensorGain(SensorEffect):
    """A reading is multiplied by a factor, within the converter's range."""

    name = "sensor_gain"
    doc = "a sensor's readings are scaled"
    source = "assumed: a supply or amplifier that has changed"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.0,
            high=4.0,
            doc="reading after over reading before; bounds assumed",
            example=0.8,
        ),
    )

    def apply(
        self,
        times: np.ndarray,
        readings: np.ndarray,
        channels: tuple[str, ...],
        active: np.ndarray,
        rng: np.random.Generator,
    ) -> np.ndarray:
        changed = readings.copy()
        if self.is_nominal:
            return changed
        which = columns(self, channels)
        on = np.ix_(active, which)
        changed[on] = limited(readings[on] * self["factor"])
        return changed
