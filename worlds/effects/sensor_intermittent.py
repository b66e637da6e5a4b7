"""Sensor intermittent: every m-th reading is lost."""

import numpy as np

from bns.worlds.effects.base import Parameter, SensorEffect
from bns.worlds.effects.common import rarer
from bns.worlds.effects.sensors import FULL_SCALE, SENSOR, columns


class SensorIntermittent(SensorEffect):
    """Every m-th reading of a trial is the minimum value instead."""

    name = "sensor_intermittent"
    doc = "every m-th reading of a sensor is the minimum"
    source = "thesis 6.2.1 and 6.3.1: once every m readings; m is silent"
    choices = (SENSOR,)
    parameters = (
        Parameter(
            "every",
            unit="1",
            nominal=0,
            low=0,
            high=1000,
            doc="m: readings m, 2m, ... of a trial are hit; 0 = never; assumed",
            example=3,
            integer=True,
        ),
        Parameter(
            "reading",
            unit="count",
            nominal=0.0,
            low=0.0,
            high=FULL_SCALE,
            doc="what is read then",
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
        number = np.arange(1, len(times) + 1)
        hit = active & (number % int(self["every"]) == 0)
        changed[np.ix_(hit, columns(self, channels))] = self["reading"]
        return changed

    def scaled(self, severity: float) -> "SensorIntermittent":
        """Milder means rarer: half the severity hits half as many readings."""
        every = rarer(self, severity)
        return type(self)({**super().scaled(severity).values, "every": every})
