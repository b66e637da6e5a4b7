"""Readings of light sensors that depend on those before."""

import numpy as np

from bns.worlds.effects.base import SensorEffect, strength
from bns.worlds.effects.common import spans
from bns.worlds.effects.sensors import SENSOR, columns, limited


class SensorDrift(SensorEffect):
    """A sensor's readings drift with time."""

    name = "sensor_drift"
    source = "assumed: a sensor that warms up"
    choices = (SENSOR,)
    parameters = (
        strength(
            "rate",
            "count/s",
            (-1000.0, 1000.0),
            "added for each second that it lasts; bounds assumed",
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
    """A sensor repeats one reading."""

    name = "sensor_frozen"
    source = "assumed: a converter that no longer updates"
    choices = (SENSOR,)
    parameters = (
        strength(
            "blend",
            "1",
            (0.0, 1.0),
            "from the reading (0) to the frozen one (1)",
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
    """A sensor's readings lag behind."""

    name = "sensor_response_time"
    source = "thesis 5.2.2 gives 50 ms for an answer; a lag beyond that is assumed"
    choices = (SENSOR,)
    parameters = (
        strength(
            "time_constant",
            "s",
            (0.0, 10.0),
            "of the filter; 0 = none; bounds assumed",
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
