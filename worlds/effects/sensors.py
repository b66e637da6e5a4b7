"""Readings of light sensors: changed one by one, or by those before."""

from abc import abstractmethod
from typing import NamedTuple

import numpy as np

from bns.models.light_sites import NAMES, SIDES, twin
from bns.worlds.effects.base import (
    Choice,
    Effect,
    Parameter,
    SensorEffect,
    factor,
    place,
    strength,
)
from bns.worlds.effects.command import rarer, spans

# [count] 12 bits; the dissertation writes 4200, the maker's test program scales by 4096
FULL_SCALE = 4095.0

FORWARD = tuple(name.removeprefix("ir_") for side in SIDES.values() for name in side)
SINGLE = tuple(name.removeprefix("ir_") for name in NAMES)
"""each sensor as effects call it"""

SENSOR = Choice(
    "sensor",
    ("all", "left", "right", *SINGLE),
    "all",
    "which sensors are affected; left and right: those of a virtual sensor",
)


def columns(effect: Effect, channels: tuple[str, ...]) -> list[int]:
    """Columns of the sensors that the effect's choice `sensor` names."""
    choice = effect["sensor"]
    if choice == "all":
        return list(range(len(channels)))
    wanted = SIDES.get(choice, (f"ir_{choice}",))
    return [at for at, name in enumerate(channels) if name in wanted]


def limited(readings: np.ndarray) -> np.ndarray:
    """Readings that a converter can give [count]."""
    return np.clip(readings, 0.0, FULL_SCALE)


class Stretch(NamedTuple):
    """Readings, and the stretch of time in which an effect is on.

    Attributes:
        times: of all readings [s], ``(T,)``.
        readings: of all sensors, ``(T, S)`` [counts].
        span: the stretch.
        which: columns of the chosen sensors.
    """

    times: np.ndarray
    readings: np.ndarray
    span: slice
    which: list[int]

    @property
    def chosen(self) -> np.ndarray:
        """What the chosen sensors read in it, ``(P, W)`` [counts]."""
        return self.readings[self.span, self.which]

    @property
    def before(self) -> int:
        """The last reading before it, or the first of all."""
        return max(self.span.start - 1, 0)


class ReadingEffect(SensorEffect):
    """What the chosen sensors read is computed from readings, without chance."""

    choices = (SENSOR,)

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
        if not self.is_nominal:
            which = columns(self, channels)
            for span in spans(active):
                seen = Stretch(times, readings, span, which)
                changed[span, which] = self._read(seen)
        return changed

    @abstractmethod
    def _read(self, seen: Stretch) -> np.ndarray:
        """What is read instead of `seen.chosen`, of the same shape."""


class SensorGain(ReadingEffect):
    """A sensor's readings are scaled."""

    name = "sensor_gain"
    source = "assumed: a supply or amplifier that has changed"
    parameter = factor(
        (0.0, 4.0), "reading after over reading before; bounds assumed", example=0.8
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        return limited(seen.chosen * self["factor"])


class SensorOffset(ReadingEffect):
    """A sensor's readings are shifted."""

    name = "sensor_offset"
    source = "assumed: a dirty or heated sensor"
    parameter = strength(
        "counts",
        "count",
        (-4095.0, 4095.0),
        "added to each reading; the whole range",
        example=-500.0,
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        return limited(seen.chosen + self["counts"])


class SensorSaturation(ReadingEffect):
    """A sensor saturates before full light."""

    name = "sensor_saturation"
    source = "assumed: a load resistor or supply that has changed"
    parameter = strength(
        "level",
        "count",
        (0.0, FULL_SCALE),
        "smallest reading; 0 = down to full light",
        example=1500.0,
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        return np.maximum(seen.chosen, self["level"])


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
        place("reading", "count", reading, (0.0, FULL_SCALE), f"the {extreme}"),
    )


class _StuckSensor(ReadingEffect):
    def _read(self, seen: Stretch) -> np.ndarray:
        before = seen.chosen
        return before + self["blend"] * (self["reading"] - before)


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


class SensorCrosstalk(ReadingEffect):
    """Neighbouring sensors leak into a reading."""

    name = "sensor_crosstalk"
    source = "assumed: one multiplexer serves all sensors"
    parameter = strength(
        "share",
        "1",
        (0.0, 0.5),
        "of the reading that is the neighbours' mean; bounds assumed",
        example=0.2,
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        beside = (
            np.roll(seen.readings, 1, axis=1) + np.roll(seen.readings, -1, axis=1)
        ) / 2
        before = seen.chosen
        return before + self["share"] * (beside[seen.span, seen.which] - before)


class SensorIntermittent(ReadingEffect):
    """Every m-th reading of a sensor is the minimum."""

    name = "sensor_intermittent"
    source = "thesis 6.2.1 and 6.3.1: once every m readings; m is silent"
    parameters = (
        strength(
            "every",
            "1",
            (0, 1000),
            "m: readings m, 2m, ... of a trial are hit; 0 = never; assumed",
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

    def _read(self, seen: Stretch) -> np.ndarray:
        number = np.arange(seen.span.start + 1, seen.span.stop + 1)
        hit = number % int(self["every"]) == 0
        return np.where(hit[:, None], self["reading"], seen.chosen)

    def scaled(self, severity: float) -> "SensorIntermittent":
        """Milder means rarer: half the severity hits half as many readings."""
        every = rarer(self, severity)
        return type(self)({**super().scaled(severity).values, "every": every})


class SensorSwapped(SensorEffect):
    """Left and right sensors are exchanged."""

    name = "sensor_swapped"
    source = "assumed: a plug in the wrong socket"
    parameter = strength(
        "blend",
        "1",
        (0.0, 1.0),
        "from their own reading (0) to that of their twin (1)",
        example=1.0,
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


class SensorDrift(ReadingEffect):
    """A sensor's readings drift with time."""

    name = "sensor_drift"
    source = "assumed: a sensor that warms up"
    parameter = strength(
        "rate",
        "count/s",
        (-1000.0, 1000.0),
        "added for each second that it lasts; bounds assumed",
        example=-40.0,
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        since = (seen.times[seen.span] - seen.times[seen.before])[:, None]
        return limited(seen.chosen + self["rate"] * since)


class SensorFrozen(ReadingEffect):
    """A sensor repeats one reading."""

    name = "sensor_frozen"
    source = "assumed: a converter that no longer updates"
    parameter = strength(
        "blend",
        "1",
        (0.0, 1.0),
        "from the reading (0) to the frozen one (1)",
        example=1.0,
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        kept, before = seen.readings[seen.before, seen.which], seen.chosen
        return before + self["blend"] * (kept - before)


class SensorResponseTime(ReadingEffect):
    """A sensor's readings lag behind."""

    name = "sensor_response_time"
    source = "thesis 5.2.2 gives 50 ms for an answer; a lag beyond that is assumed"
    parameter = strength(
        "time_constant",
        "s",
        (0.0, 10.0),
        "of the filter; 0 = none; bounds assumed",
        example=0.5,
    )

    def _read(self, seen: Stretch) -> np.ndarray:
        keep = np.exp(
            -np.diff(seen.times, prepend=seen.times[0]) / self["time_constant"]
        )
        read = seen.chosen
        last = seen.readings[seen.before, seen.which]
        for at, share in enumerate(keep[seen.span]):
            read[at] = last = read[at] + share * (last - read[at])
        return read
