"""Columns of numbers from a CSV file with a line of names."""

from collections.abc import Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError
from bns.storage import reading

THREADS = 1 << 20  # [bytes] above which several threads are worth it


def read(
    path: Path | str, wanted: Sequence[str] | None = None, *, delimiter: str = ","
) -> dict[str, np.ndarray]:
    """Columns as doubles; empty cells are NaN.

    Args:
        path: of the file.
        wanted: names of the columns; None = all.
        delimiter: between columns.

    Returns:
        name -> column, ``(N,)``, N rows.

    Raises:
        FormatError: not there, no table, a column missing, twice or not of numbers.
    """
    import pyarrow
    from pyarrow import csv

    data = reading.read_bytes(path, most=reading.DATA)
    try:
        table = csv.read_csv(
            pyarrow.BufferReader(data),
            read_options=csv.ReadOptions(use_threads=len(data) > THREADS),
            parse_options=csv.ParseOptions(delimiter=delimiter),
        )
        names = table.column_names
    except (*reading.UNREADABLE, pyarrow.ArrowException) as error:
        first = str(error).partition("\n")[0]
        raise FormatError(f"{path} cannot be read as CSV: {first}.") from error
    chosen = names if wanted is None else list(dict.fromkeys(wanted))
    for name in chosen:
        if names.count(name) != 1:
            state = "is there twice" if name in names else "is missing"
            raise FormatError(
                f"{path}: the column {name!r} {state}; there are {', '.join(names)}."
            )
    return {name: _column(table.column(name), name, path) for name in chosen}


def _column(column: Any, name: str, path: Path | str) -> np.ndarray:
    from pyarrow import types

    kind = column.type
    if not (types.is_integer(kind) or types.is_floating(kind) or types.is_null(kind)):
        raise FormatError(f"{path}: column {name!r} is {kind}, it needs numbers.")
    try:
        made = column.cast("float64", safe=False).fill_null(np.nan)
    except reading.UNREADABLE as error:
        raise FormatError(f"{path}: column {name!r}: {error}.") from error
    return made.to_numpy()
