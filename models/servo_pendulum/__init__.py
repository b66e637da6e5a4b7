"""A position servo that lifts a mass on a lever: MJCF, and the numbers of its law."""

from pathlib import Path

from bns.models import servo_numbers


def law() -> dict[str, float]:
    """The nominal numbers of the servo law by name, SI units (`law.toml`).

    Raises:
        FormatError: the file is not as it should be.
    """
    return servo_numbers.law(Path(__file__).parent)
