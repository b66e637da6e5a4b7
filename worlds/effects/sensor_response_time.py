"""Sensor response time: readings lag behind the light."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.common import spans
from bns.worlds.effects.sensors import SENSOR, columns


class SensorResponseTime(SensorEffect):
    """Readings follow the light as a filter of first order does."""

    name = "sensor_response_time"
    doc = "a sensor's readings lag behind"
    source = "thesis 5.2.2 gives 50 ms for an answer; a lag beyond that is assumed"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "time_constant",
            unit="s",
            nominal=0.0,
            low=0.0,
            high=10.0,
            doc="of the filter; 0 = none; bounds assumed",
            example=0.5,
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
        keep = np.exp(-np.diff(times, prepend=times[0]) / self["time_constant"])
        for span in spans(active):
            last = readings[max(span.start - 1, 0), which]
            for at in range(span.start, span.stop):
                last = readings[at, which] + keep[at] * (last - readings[at, which])
                changed[at, which] = last
        return changed
