"""Nominal numbers of a servo law, read from a servo's `law.toml`.

One table per number, with value, unit, basis and source; where a number is uncertain,
`low` and `high` say between what it may lie.
"""

from functools import cache
from pathlib import Path

import msgspec

from bns.errors import FormatError
from bns.models.numbers import Basis
from bns.storage import reading
from bns.storage.numbers import Finite

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
