"""Readings of any robot, channel by channel: gain, offset and delay.

Light sensors have effects of their own, within the range of their converter:
`sensor_gain`, `sensor_offset`, `sensor_response_time`.
"""

from abc import abstractmethod

import numpy as np

from bns.worlds.effects import parts
from bns.worlds.effects.base import SensorEffect, factor, strength
from bns.worlds.effects.parts import WIDE


class _Channel(SensorEffect):
    """What is read of one channel becomes something else."""

    robots = ("own",)
    choices = parts.part("channel")
    source = "a transform of what is observed"

    def apply(
        self,
        times: np.ndarray,
        readings: np.ndarray,
        channels: tuple[str, ...],
        active: np.ndarray,
        rng: np.random.Generator,
    ) -> np.ndarray:
        """The readings with the columns of the part changed."""
        made = readings.copy()
        if self.is_nominal:
            return made
        for column in parts.among(channels, self["part"], "observed channel"):
            changed = self.change(times, readings[:, column])
            made[active, column] = changed[active]
        return made

    @abstractmethod
    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """One channel, ``(T,)``, after the effect."""


class ReadingGain(_Channel):
    """The readings of any sensor are scaled."""

    name = "reading_gain"
    parameters = (factor((0.0, WIDE), "reading over the true value", example=0.8),)

    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """The readings scaled, ``(T,)``."""
        return readings * self["factor"]


class ReadingOffset(_Channel):
    """The readings of any sensor are shifted by a constant."""

    name = "reading_offset"
    parameters = (
        strength(
            "added",
            "unit of the reading",
            (-WIDE, WIDE),
            "added to the reading",
            example=0.1,
        ),
    )

    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """The readings shifted in value, ``(T,)``."""
        return readings + self["added"]


class ReadingDelay(_Channel):
    """The readings of any sensor are older than their time stamps."""

    name = "reading_delay"
    parameters = (
        strength("delay", "s", (-WIDE, WIDE), "age of a reading", example=0.5),
    )

    def change(self, times: np.ndarray, readings: np.ndarray) -> np.ndarray:
        """The readings shifted in time, ``(T,)``."""
        return np.interp(times - self["delay"], times, readings)
