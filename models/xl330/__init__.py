"""Robotis Dynamixel XL330-M288: its servo law as others published it (`law.toml`)."""

from pathlib import Path

from bns.models import servo_numbers


def law() -> dict[str, float]:
    """The published numbers of the servo law by name, SI units.

    Raises:
        FormatError: the file is not as it should be.
    """
    return servo_numbers.law(Path(__file__).parent)
