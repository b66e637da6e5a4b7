"""Sensor saturation: readings stop short of full light."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.sensors import FULL_SCALE, SENSOR, columns


class SensorSaturation(SensorEffect):
    """A sensor saturates early: no reading is below a level (bright is small)."""

    name = "sensor_saturation"
    doc = "a sensor saturates before full light"
    source = "assumed: a load resistor or supply that has changed"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "level",
            unit="count",
            nominal=0.0,
            low=0.0,
            high=FULL_SCALE,
            doc="smallest reading; 0 = down to full light",
            example=1500.0,
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
        changed[on] = np.maximum(readings[on], self["level"])
        return changed
