"""Sensor drift: readings wander off with time."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.common import spans
from bns.worlds.effects.sensors import SENSOR, columns, limited


class SensorDrift(SensorEffect):
    """A sensor's readings are shifted more and more, from when it sets in."""

    name = "sensor_drift"
    doc = "a sensor's readings drift with time"
    source = "assumed: a sensor that warms up"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "rate",
            unit="count/s",
            nominal=0.0,
            low=-1000.0,
            high=1000.0,
            doc="added for each second that it lasts; bounds assumed",
            example=-40.0,
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
        for span in spans(active):
            since = (times[span] - times[max(span.start - 1, 0)])[:, None]
            changed[span, which] = limited(readings[span, which] + self["rate"] * since)
        return changed
