"""Nominal numbers of a servo law, read from a servo's `law.toml`.

One table per number, with value, unit, basis and source; where a number is uncertain,
`low` and `high` say between what it may lie.
"""

import tomllib
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from bns.errors import FormatError
from bns.models.numbers import BASES

LAW = "law.toml"


@cache
def _tables(file: Path) -> dict[str, Mapping[str, Any]]:
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
        bare = [
            name
            for name, table in tables.items()
            if table["basis"] not in BASES or not (table["source"] and table["unit"])
        ]
        for table in tables.values():
            float(table["value"])
    except (OSError, ValueError, KeyError, TypeError) as error:
        raise FormatError(f"{file} is not a table of numbers: {error}.") from error
    if bare:
        raise FormatError(f"{file}: {bare[0]} lacks a basis, source or unit.")
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
    return {name: float(table["value"]) for name, table in _tables(file).items()}


def uncertain(directory: Path) -> dict[str, tuple[float, float]]:
    """Smallest and largest likely value of each uncertain number, by name.

    Raises:
        FormatError: the file is not as it should be.
    """
    return {
        name: (float(table["low"]), float(table["high"]))
        for name, table in _tables(directory / LAW).items()
        if "low" in table
    }
