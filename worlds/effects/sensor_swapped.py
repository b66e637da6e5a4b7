"""Sensors swapped: left and right are exchanged."""

import numpy as np

from bns.models.light_sites import twin
from bns.worlds.effects.base import Parameter, SensorEffect


class SensorSwapped(SensorEffect):
    """What the left sensors read is given for the right ones, and vice versa."""

    name = "sensor_swapped"
    doc = "left and right sensors are exchanged"
    source = "assumed: a plug in the wrong socket"
    parameters = (
        Parameter(
            "blend",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=1.0,
            doc="from their own reading (0) to that of their twin (1)",
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
        from_there = [channels.index(twin(name)) for name in channels]
        changed[active] += self["blend"] * (
            readings[active][:, from_there] - readings[active]
        )
        return changed
