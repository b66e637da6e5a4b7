"""Sensor stuck at its minimum."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.sensors import FULL_SCALE, SENSOR, columns


class SensorStuckMin(SensorEffect):
    """A sensor always returns the minimum value (bright)."""

    name = "sensor_stuck_min"
    doc = "a sensor always reads the minimum: it reads bright"
    source = "thesis 6.2.1: always returns the minimum sensor value"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "blend",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="from the reading (0) to the minimum (1)",
            example=1.0,
        ),
        Parameter(
            "reading",
            unit="count",
            nominal=0.0,
            low=0.0,
            high=FULL_SCALE,
            doc="the minimum",
            example=0.0,
            scales=False,
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
        changed[on] += self["blend"] * (self["reading"] - readings[on])
        return changed
