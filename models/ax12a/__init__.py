"""Robotis Dynamixel AX-12A: its servo law, and angles as its registers hold them.

The law's numbers lie in `law.toml`, each with unit, basis, source and, where uncertain,
between what it may lie.
"""

from pathlib import Path

import numpy as np

from bns.models import servo_numbers

UNITS_PER_TURN = 360 * 1023 / 300  # [1/turn] 300 deg are 1023 units (e-manual)
UNIT = 2 * np.pi / UNITS_PER_TURN  # [rad]
HALFWAY = 512  # [units] the middle of the goal register
SPEED_UNIT = 0.111 * 2 * np.pi / 60  # [rad/s] of the moving speed register (e-manual)
NO_LOAD_SPEED = 59 * 2 * np.pi / 60  # [rad/s] at 12 V (e-manual)
MASS = 0.0546  # [kg] (e-manual)
HOTTEST = 70.0  # [deg C] at which it shuts down (e-manual, address 11)

_HERE = Path(__file__).parent


def law() -> dict[str, float]:
    """The nominal numbers of the servo law by name, SI units.

    Raises:
        FormatError: the file is not as it should be.
    """
    return servo_numbers.law(_HERE)


def uncertain() -> dict[str, tuple[float, float]]:
    """Smallest and largest likely value of each uncertain number, by name.

    Raises:
        FormatError: the file is not as it should be.
    """
    return servo_numbers.uncertain(_HERE)


def units(angle: np.ndarray) -> np.ndarray:
    """Goal register for angles from half-way [rad], whole numbers.

    The register holds 0 to 1023; what lies beyond is not clipped here.
    """
    return np.rint(np.asarray(angle) / UNIT).astype(np.int64) + HALFWAY


def angle(units: np.ndarray) -> np.ndarray:
    """Angles from half-way [rad] that goal registers stand for."""
    return (np.asarray(units) - HALFWAY) * UNIT
