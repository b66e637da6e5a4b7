"""Readings of light sensors that depend on those before."""

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
        """See `SensorEffect.apply`."""
        changed = readings.copy()
        if self.is_nominal:
            return changed
        which = columns(self, channels)
        for span in spans(active):
            since = (times[span] - times[max(span.start - 1, 0)])[:, None]
            changed[span, which] = limited(readings[span, which] + self["rate"] * since)
        return changed


class SensorFrozen(SensorEffect):
    """A sensor goes on giving what it gave before it froze, or first in the trial."""

    name = "sensor_frozen"
    doc = "a sensor repeats one reading"
    source = "assumed: a converter that no longer updates"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "blend",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="from the reading (0) to the frozen one (1)",
            example=1.0,
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
        """See `SensorEffect.apply`."""
        changed = readings.copy()
        if self.is_nominal:
            return changed
        which = columns(self, channels)
        for span in spans(active):
            kept = readings[max(span.start - 1, 0), which]
            changed[span, which] += self["blend"] * (kept - readings[span, which])
        return changed


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
        """See `SensorEffect.apply`."""
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
