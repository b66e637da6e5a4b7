"""Units that logs are written in, and what makes SI of them."""

from collections.abc import Mapping

import numpy as np

SPEED_UNIT = 1e-3 / 144.01  # [m/s] Khepera III manual 2.2, p. 14 (firmware < 3)
FACTORS: Mapping[str, Mapping[str, float]] = {
    "s": {"s": 1.0, "ms": 1e-3, "us": 1e-6, "ns": 1e-9},
    "m": {"m": 1.0, "cm": 1e-2, "mm": 1e-3},
    "rad": {"rad": 1.0, "deg": np.pi / 180, "turn": 2 * np.pi},
    "m/s": {"m/s": 1.0, "cm/s": 1e-2, "mm/s": 1e-3, "khepera-speed": SPEED_UNIT},
    "rad/s": {"rad/s": 1.0, "deg/s": np.pi / 180, "rpm": np.pi / 30},
}
"""what a value is multiplied by, by unit, by the SI unit it becomes"""
RATES = frozenset({*FACTORS["m/s"], *FACTORS["rad/s"]})
"""units of speeds"""


def factor(unit: str) -> float:
    """What a value in a unit is multiplied by for SI; 1 for an unknown unit."""
    return FACTORS.get(si_unit(unit), {}).get(unit, 1.0)


def si_unit(unit: str) -> str:
    """The SI unit that goes with a unit; an unknown unit as it is."""
    return next((name for name, row in FACTORS.items() if unit in row), unit)


def per_si(name: str) -> dict[str, float]:
    """How much of each unit makes one of an SI unit.

    Args:
        name: of the SI unit, "m", "rad", ...
    """
    return {unit: 1 / size for unit, size in FACTORS[name].items()}


def wrapped(angles: np.ndarray) -> np.ndarray:
    """Angles within half a turn of zero [rad]."""
    return (np.asarray(angles) + np.pi) % (2 * np.pi) - np.pi
