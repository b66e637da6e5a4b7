"""Sensor offset: readings are shifted."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.sensors import SENSOR, columns, limited


class SensorOffset(SensorEffect):
    """A constant is added to a reading, within the converter's range."""

    name = "sensor_offset"
    doc = "a sensor's readings are shifted"
    source = "assumed: a dirty or heated sensor"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "counts",
            unit="count",
            nominal=0.0,
            low=-4095.0,
            high=4095.0,
            doc="added to each reading; the whole range",
            example=-500.0,
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
        changed[on] = limited(readings[on] + self["counts"])
        return changed
