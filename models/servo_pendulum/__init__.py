"""A position servo that lifts a mass on a lever: MJCF, and the numbers of its law."""

import tomllib
from functools import cache
from pathlib import Path

from bns.errors import FormatError
from bns.models.numbers import BASES

LAW = "law.toml"


@cache
def _values() -> tuple[tuple[str, float], ...]:
    file = Path(__file__).parent / LAW
    try:
        tables = tomllib.loads(file.read_text(encoding="utf-8"))
        for name, table in tables.items():
            if table["basis"] not in BASES or not (table["source"] and table["unit"]):
                raise FormatError(f"{file}: {name} lacks a basis, source or unit.")
        return tuple((name, float(table["value"])) for name, table in tables.items())
    except (tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise FormatError(f"{file} is not a table of numbers: {error}.") from error


def law() -> dict[str, float]:
    """The nominal numbers of the servo law by name, SI units (`law.toml`).

    Raises:
        FormatError: the file is not as it should be.
    """
    return dict(_values())
