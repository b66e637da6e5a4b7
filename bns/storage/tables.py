"""Tables of numbers: Parquet, or NPZ where pyarrow is missing, in directories of ours.

pyarrow is a seventh of what a small installation would be, so it is an extra. A table
has one name, that of its Parquet file; the NPZ beside it has the same columns, and
both are read wherever they come from. CSV is read from elsewhere: a line of names, and
columns of numbers.
"""

import hashlib
from collections.abc import Mapping, Sequence
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError
from bns.storage import arrays, parquet, reading, seal

KINDS = {"double": np.dtype(np.float64), "int64": np.dtype(np.int64)}
"""Arrow's name of a type -> NumPy's"""
KEY = "sha256"
"""array of an NPZ that holds the digest of the others"""


def write(path: Path, columns: Mapping[str, np.ndarray], **options: Any) -> None:
    """Write columns of equal length; the file is whole or absent.

    Args:
        path: of the Parquet file; without pyarrow its suffix becomes `.npz`.
        columns: name -> ``(N,)``.
        options: of `parquet.write`.

    Raises:
        StorageError: no space, or no permission.
    """
    if find_spec("pyarrow"):
        parquet.write(path, columns, **options)
    else:
        write_plain(path, columns)


def write_plain(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns as NPZ, with a digest: the archive's checksums miss a lost member.

    Args:
        path: of the Parquet file in whose place it is.
        columns: name -> ``(N,)``.

    Raises:
        StorageError: no space, or no permission.
    """
    held = {**columns, KEY: np.array(_digest(columns))}
    arrays.write_npz(_npz(path), held, compressed=True)


def exists(path: Path) -> bool:
    """Whether the table is there, one way or the other."""
    return path.exists() or _npz(path).exists()


def read(
    path: Path, keys: Mapping[str, str], channels: Mapping[str, str] | None = None
) -> dict[str, np.ndarray]:
    """Columns of a table that `write` wrote.

    Args:
        path: of the Parquet file.
        keys: columns that are needed, and Arrow's name of their type.
        channels: likewise; None = all others there are, which have to be doubles.

    Returns:
        name -> column, ``(N,)``; of NPZ and of Parquet the same.

    Raises:
        FormatError: absent, torn, damaged, a column missing or of another type.
    """
    if path.exists() or not _npz(path).exists():
        table = parquet.read(path)
        others = dict.fromkeys(table.column_names, "double")
        wanted = {**(others if channels is None else channels), **keys}
        return parquet.numbers(table, wanted, path)
    path = _npz(path)
    found = arrays.read_npz(path)
    said = found.pop(KEY, None)
    if said is None or str(said) != _digest(found):
        raise seal.damaged(path)
    others = dict.fromkeys(found, "double")
    wanted = {**(others if channels is None else channels), **keys}
    _check(found, wanted, path)
    return {name: found[name] for name in wanted}


def _npz(path: Path) -> Path:
    return path.with_suffix(".npz")


def _digest(columns: Mapping[str, np.ndarray]) -> str:
    """SHA-256 of names, types, shapes and values of all columns."""
    made = hashlib.sha256()
    for name, column in columns.items():
        made.update(repr((name, column.dtype.str, column.shape)).encode())
        made.update(np.ascontiguousarray(column).tobytes())
    return made.hexdigest()


def _check(
    found: Mapping[str, np.ndarray], wanted: Mapping[str, str], path: Path
) -> None:
    """Stop at arrays that are no such table.

    Raises:
        FormatError: a column is missing, of another type, or of another length.
    """
    rows = {array.shape for array in found.values()}
    if len(rows) > 1 or any(len(shape) != 1 for shape in rows):
        raise FormatError(f"{path} holds no table: its arrays differ in shape.")
    missing = [name for name in wanted if name not in found]
    if missing:
        raise FormatError(
            f"{path} lacks the columns {', '.join(missing)}; it has {', '.join(found)}."
        )
    for name, kind in wanted.items():
        if found[name].dtype != KINDS[kind]:
            raise FormatError(
                f"{path}: column {name!r} is {found[name].dtype}, it needs {kind}."
            )


THREADS = 1 << 20  # [bytes] above which several threads are worth it


def read_csv(
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
    table, names = parsed(data, path, delimiter)
    chosen = names if wanted is None else list(dict.fromkeys(wanted))
    once(chosen, names, path)
    return {name: doubles(table.column(name), name, path) for name in chosen}


def parsed(
    data: bytes, path: Path | str, delimiter: str, decimal: str = "."
) -> tuple[Any, list[str]]:
    """The `pyarrow.Table` in the bytes of a CSV file, and the names of its columns.

    Args:
        data: of the file.
        path: of the file, for messages.
        delimiter: what parts columns.
        decimal: point of its numbers.

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
            convert_options=csv.ConvertOptions(decimal_point=decimal),
        )
        names = table.column_names  # fails where they are not UTF-8
    except (*reading.UNREADABLE, pyarrow.ArrowException) as error:
        first = str(error).partition("\n")[0]
        raise FormatError(f"{path} cannot be read as CSV: {first}.") from error
    return table, names


def once(chosen: Sequence[str], names: Sequence[str], path: Path | str) -> None:
    """Stop at a column that is not there, or there twice.

    Args:
        chosen: names that are wanted.
        names: of the columns of a file.
        path: of the file, for messages.

    Raises:
        FormatError: there is one.
    """
    for name in chosen:
        if names.count(name) != 1:
            state = "is there twice" if name in names else "is missing"
            raise FormatError(
                f"{path}: the column {name!r} {state}; there are {', '.join(names)}."
            )


def is_number(kind: Any) -> bool:
    """Whether a type of Arrow is one of numbers; so is that of a column left empty."""
    from pyarrow import types

    return bool(
        types.is_integer(kind) or types.is_floating(kind) or types.is_null(kind)
    )


def doubles(column: Any, name: str, path: Path | str) -> np.ndarray:
    """A column of `pyarrow.Table` as doubles ``(N,)``; empty cells are NaN.

    Args:
        column: of numbers.
        name: of the column, for messages.
        path: of the file, for messages.

    Raises:
        FormatError: it is none of numbers.
    """
    if not is_number(column.type):
        raise FormatError(
            f"{path}: column {name!r} is {column.type}, it needs numbers."
        )
    try:
        made = column.cast("float64", safe=False).fill_null(np.nan)
    except reading.UNREADABLE as error:
        raise FormatError(f"{path}: column {name!r}: {error}.") from error
    return made.to_numpy()
