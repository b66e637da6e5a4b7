"""What effects on light sensors share: which sensors, and the range of a reading."""

import numpy as np

from bns.models.light_sites import NAMES, SIDES
from bns.worlds.effects.base import Choice, Effect

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
