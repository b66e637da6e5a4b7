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
    data = reading.read_bytes(path, most=reading.DATA)
    table, names = _parsed(data, path, delimiter)
    chosen = names if wanted is None else list(dict.fromkeys(wanted))
    _once(chosen, names, path)
    return {name: _column(table.column(name), name, path) for name in chosen}


def read_numbers(path: Path | str, *, delimiter: str = ",") -> dict[str, np.ndarray]:
    """Columns of numbers and of truth values as doubles; those of text are left out.

    Args:
        path: of the file; one that ends with `.gz` is unpacked.
        delimiter: between columns.

    Returns:
        name -> column, ``(N,)``, N rows; empty cells are NaN.

    Raises:
        FormatError: not there, no table, or a column twice.
    """
    from pyarrow import types

    packed = str(path).lower().endswith(".gz")
    load = reading.read_packed if packed else reading.read_bytes
    table, names = _parsed(load(path, most=reading.DATA), path, delimiter)
    _once(names, names, path)
    found = {}
    for name, column in zip(names, table.columns, strict=True):
        column = column.cast("int8") if types.is_boolean(column.type) else column
        if _counts(column.type):
            found[name] = _column(column, name, path)
    return found


def _parsed(data: bytes, path: Path | str, delimiter: str) -> tuple[Any, list[str]]:
    """The `pyarrow.Table` in the bytes of a file, and the names of its columns.

    Raises:
        FormatError: there is none.
    """
    import pyarrow
    from pyarrow import csv

    try:
        table = csv.read_csv(
            pyarrow.BufferReader(data),
            read_options=csv.ReadOptions(use_threads=len(data) > THREADS),
            parse_options=csv.ParseOptions(delimiter=delimiter),
        )
        names = table.column_names  # fails where they are not UTF-8
    except (*reading.UNREADABLE, pyarrow.ArrowException) as error:
        first = str(error).partition("\n")[0]
        raise FormatError(f"{path} cannot be read as CSV: {first}.") from error
    return table, names


def _once(chosen: Sequence[str], names: Sequence[str], path: Path | str) -> None:
    """Stop at a column that is not there, or there twice.

    Raises:
        FormatError: there is one.
    """
    for name in chosen:
        if names.count(name) != 1:
            state = "is there twice" if name in names else "is missing"
            raise FormatError(
                f"{path}: the column {name!r} {state}; there are {', '.join(names)}."
            )


def _counts(kind: Any) -> bool:
    """Whether a type of Arrow is one of numbers; so is that of a column left empty."""
    from pyarrow import types

    return bool(
        types.is_integer(kind) or types.is_floating(kind) or types.is_null(kind)
    )


def _column(column: Any, name: str, path: Path | str) -> np.ndarray:
    if not _counts(column.type):
        raise FormatError(
            f"{path}: column {name!r} is {column.type}, it needs numbers."
        )
    try:
        made = column.cast("float64", safe=False).fill_null(np.nan)
    except reading.UNREADABLE as error:
        raise FormatError(f"{path}: column {name!r}: {error}.") from error
    return made.to_numpy()
