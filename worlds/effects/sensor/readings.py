"""Readings of light sensors, one at a time."""

from abc import abstractmethod

import numpy as np

from bns.models.light_sites import twin
from bns.worlds.effects.base import Parameter, SensorEffect, factor, strength
from bns.worlds.effects.common import rarer
from bns.worlds.effects.sensors import FULL_SCALE, SENSOR, columns, limited


class _EachReading(SensorEffect):
    """A reading of the chosen sensors becomes another one, whatever came before."""

    choices = (SENSOR,)

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
        on = np.ix_(active, np.array(columns(self, channels), dtype=int))
        changed[on] = self.read(readings, on)
        return changed

    @abstractmethod
    def read(self, readings: np.ndarray, on: tuple[np.ndarray, ...]) -> np.ndarray:
        """What is read instead of ``readings[on]``."""


class SensorGain(_EachReading):
    """A sensor's readings are scaled."""

    name = "sensor_gain"
    source = "assumed: a supply or amplifier that has changed"
    parameters = (
        factor(
            (0.0, 4.0), "reading after over reading before; bounds assumed", example=0.8
        ),
    )

    def read(self, readings: np.ndarray, on: tuple[np.ndarray, ...]) -> np.ndarray:
        """The readings that are on, scaled, within the converter's range.

        Args:
            readings: of all sensors, ``(T, S)`` [counts].
            on: indices of the rows and columns in which the effect is on.

        Returns:
            like ``readings[on]``.
        """
        return limited(readings[on] * self["factor"])


class SensorOffset(_EachReading):
    """A sensor's readings are shifted."""

    name = "sensor_offset"
    source = "assumed: a dirty or heated sensor"
    parameters = (
        strength(
            "counts",
            "count",
            (-4095.0, 4095.0),
            "added to each reading; the whole range",
            example=-500.0,
        ),
    )

    def read(self, readings: np.ndarray, on: tuple[np.ndarray, ...]) -> np.ndarray:
        """The readings that are on, shifted, within the converter's range.

        Args:
            readings: of all sensors, ``(T, S)`` [counts].
            on: indices of the rows and columns in which the effect is on.

        Returns:
            like ``readings[on]``.
        """
        return limited(readings[on] + self["counts"])


class SensorSaturation(_EachReading):
    """A sensor saturates before full light."""

    name = "sensor_saturation"
    source = "assumed: a load resistor or supply that has changed"
    parameters = (
        strength(
            "level",
            "count",
            (0.0, FULL_SCALE),
            "smallest reading; 0 = down to full light",
            example=1500.0,
        ),
    )

    def read(self, readings: np.ndarray, on: tuple[np.ndarray, ...]) -> np.ndarray:
        """The readings that are on, none below the level.

        Args:
            readings: of all sensors, ``(T, S)`` [counts].
            on: indices of the rows and columns in which the effect is on.

        Returns:
            like ``readings[on]``.
        """
        return np.maximum(readings[on], self["level"])


def _stuck(extreme: str, reading: float) -> tuple[Parameter, ...]:
    """The parameters of a sensor that is stuck at an extreme reading."""
    return (
        strength(
            "blend",
            "1",
            (0.0, 1.0),
            f"from the reading (0) to the {extreme} (1)",
            example=1.0,
        ),
        Parameter(
            "reading",
            unit="count",
            nominal=reading,
            low=0.0,
            high=FULL_SCALE,
            doc=f"the {extreme}",
            example=reading,
            scales=False,
        ),
    )


class _StuckSensor(_EachReading):
    def read(self, readings: np.ndarray, on: tuple[np.ndarray, ...]) -> np.ndarray:
        return readings[on] + self["blend"] * (self["reading"] - readings[on])


class SensorStuckMax(_StuckSensor):
    """A sensor always reads the maximum: it reads dark."""

    name = "sensor_stuck_max"
    source = "thesis 6.2.1: always returns the maximum sensor value"
    parameters = _stuck("maximum", FULL_SCALE)


class SensorStuckMin(_StuckSensor):
    """A sensor always reads the minimum: it reads bright."""

    name = "sensor_stuck_min"
    source = "thesis 6.2.1: always returns the minimum sensor value"
    parameters = _stuck("minimum", 0.0)


class SensorCrosstalk(_EachReading):
    """Neighbouring sensors leak into a reading."""

    name = "sensor_crosstalk"
    source = "assumed: one multiplexer serves all sensors"
    parameters = (
        strength(
            "share",
            "1",
            (0.0, 0.5),
            "of the reading that is the neighbours' mean; bounds assumed",
            example=0.2,
        ),
    )

    def read(self, readings: np.ndarray, on: tuple[np.ndarray, ...]) -> np.ndarray:
        """The readings that are on, with a share of the mean of both sensors beside.

        Args:
            readings: of all sensors, ``(T, S)`` [counts].
            on: indices of the rows and columns in which the effect is on.

        Returns:
            like ``readings[on]``.
        """
        beside = (np.roll(readings, 1, axis=1) + np.roll(readings, -1, axis=1)) / 2
        return readings[on] + self["share"] * (beside[on] - readings[on])


class SensorIntermittent(SensorEffect):
    """Every m-th reading of a sensor is the minimum."""

    name = "sensor_intermittent"
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
        strength(
            "reading",
            "count",
            (0.0, FULL_SCALE),
            "what is read then",
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
        """See `SensorEffect.apply`."""
        changed = readings.copy()
        if self.is_nominal:
            return changed
        number = np.arange(1, len(times) + 1)
        hit = np.flatnonzero(active & (number % int(self["every"]) == 0))
        changed[hit[:, None], columns(self, channels)] = self["reading"]
        return changed

    def scaled(self, severity: float) -> "SensorIntermittent":
        """Milder means rarer: half the severity hits half as many readings."""
        every = rarer(self, severity)
        return type(self)({**super().scaled(severity).values, "every": every})


class SensorSwapped(SensorEffect):
    """Left and right sensors are exchanged."""

    name = "sensor_swapped"
    source = "assumed: a plug in the wrong socket"
    parameters = (
        strength(
            "blend",
            "1",
            (0.0, 1.0),
            "from their own reading (0) to that of their twin (1)",
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
        from_there = [channels.index(twin(name)) for name in channels]
        changed[active] += self["blend"] * (
            readings[active][:, from_there] - readings[active]
        )
        return changed
