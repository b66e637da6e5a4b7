"""Sensor frozen: it repeats its last reading."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.common import spans
from bns.worlds.effects.sensors import SENSOR, columns


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
        changed = readings.copy()
        if self.is_nominal:
            return changed
        which = columns(self, channels)
        for span in spans(active):
            kept = readings[max(span.start - 1, 0), which]
            changed[span, which] += self["blend"] * (kept - readings[span, which])
        return changed
