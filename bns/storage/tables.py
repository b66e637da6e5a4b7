"""Tables of numbers in a directory of ours: Parquet, or NPZ where pyarrow is missing.

pyarrow is a seventh of what a small installation would be, so it is an extra. A table
has one name, that of its Parquet file; the NPZ beside it has the same columns, and
both are read wherever they come from.
"""

import hashlib
from collections.abc import Mapping
from importlib.util import find_spec
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError
from bns.storage import arrays, parquet, seal

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
