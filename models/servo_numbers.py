"""Nominal numbers of a servo law, read from a servo's `law.toml`.

One table per number, with value, unit, basis and source; where a number is uncertain,
`low` and `high` say between what it may lie.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import msgspec

from bns.errors import FormatError
from bns.models.numbers import Basis
from bns.storage import reading
from bns.storage.reading import Finite

LAW = "law.toml"


class Table(msgspec.Struct):
    """A number in the file."""

    value: Finite
    unit: str
    basis: Basis
    source: str
    low: Finite | None = None
    high: Finite | None = None


@cache
def _tables(file: Path) -> dict[str, Table]:
    tables = reading.tables(reading.read_toml(file), Table, file)
    for name, table in tables.items():
        if not (table.source and table.unit):
            raise FormatError(f"{file}: {name} lacks a source or unit.")
        low, high = table.low, table.high
        if (low is None) != (high is None):
            raise FormatError(f"{file}: {name} needs both low and high, or none.")
        if low is not None and high is not None and not low <= table.value <= high:
            raise FormatError(f"{file}: {name} is not between its low and high.")
    return tables


def law(directory: Path) -> dict[str, float]:
    """The nominal numbers of the servo law by name, SI units.

    Args:
        directory: holds `law.toml`.

    Raises:
        FormatError: the file is not as it should be.
    """
    return read(directory / LAW)


def read(file: Path) -> dict[str, float]:
    """The same of a file that may be called otherwise, and lie elsewhere.

    Raises:
        FormatError: the file is not as it should be.
    """
    return {name: table.value for name, table in _tables(file).items()}


def uncertain(directory: Path) -> dict[str, tuple[float, float]]:
    """Smallest and largest likely value of each uncertain number, by name.

    Raises:
        FormatError: the file is not as it should be.
    """
    return {
        name: (table.low, table.high)
        for name, table in _tables(directory / LAW).items()
        if table.low is not None and table.high is not None
    }


STANCE_TORQUE = 0.38  # [N m] mean load of femur and tibia in the home stance


class JointNumbers(NamedTuple):
    """What of a servo law a joint and its actuator hold.

    Attributes:
        stiffness: torque per error [N m/rad].
        torque_limit: of the motor at rest [N m].
        damping: back-EMF and viscous friction [N m s/rad].
        friction: dry friction [N m].
        armature: rotor and gears [kg m2].
    """

    stiffness: float
    torque_limit: float
    damping: float
    friction: float
    armature: float


def joint_numbers(values: Mapping[str, Any], powered: float = 1.0) -> JointNumbers:
    """A servo law as numbers of a joint.

    Args:
        values: every number of the law.
        powered: share of the motor that is connected; 0 = an open bridge, which does
            not brake either.
    """
    stall = values["torque_constant"] * values["voltage"] / values["resistance"]
    brake = values["torque_constant"] ** 2 / values["resistance"]
    return JointNumbers(
        stiffness=float(powered * stall * values["gain"] * values["error_gain"]),
        torque_limit=float(powered * stall * values["duty_limit"]),
        damping=float(powered * brake + values["viscous"]),
        friction=float(values["coulomb"] + values["load_friction"] * STANCE_TORQUE),
        armature=float(values["armature"]),
    )
