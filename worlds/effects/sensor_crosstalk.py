"""Sensor cross-talk: neighbours leak into a reading."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.sensors import SENSOR, columns


class SensorCrosstalk(SensorEffect):
    """A share of a reading comes from the two sensors beside it on the ring."""

    name = "sensor_crosstalk"
    doc = "neighbouring sensors leak into a reading"
    source = "assumed: one multiplexer serves all sensors"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "share",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=0.5,
            doc="of the reading that is the neighbours' mean; bounds assumed",
            example=0.2,
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
        beside = (np.roll(readings, 1, axis=1) + np.roll(readings, -1, axis=1)) / 2
        changed[on] += self["share"] * (beside[on] - readings[on])
        return changed
