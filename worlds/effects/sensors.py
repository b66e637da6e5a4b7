"""What effects on light sensors share: which sensors, and the range of a reading."""

from abc import abstractmethod

import numpy as np

from bns.models.light_sites import NAMES, SIDES
from bns.worlds.effects.base import Choice, Effect, SensorEffect
from bns.worlds.effects.common import spans

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
                changed[span, which] = self._read(times, readings, span, which)
        return changed

    @abstractmethod
    def _read(
        self, times: np.ndarray, readings: np.ndarray, span: slice, which: list[int]
    ) -> np.ndarray:
        """What is read instead of ``readings[span, which]``.

        Args:
            times: of all readings [s], ``(T,)``.
            readings: of all sensors, ``(T, S)`` [counts].
            span: a stretch of time in which the effect is on.
            which: columns of the chosen sensors.
        """
