"""Tables as Parquet files with checksums of their pages and of all they hold."""

import hashlib
import math
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

from bns.errors import FormatError
from bns.storage import files, reading, seal

THREADS = 1 << 20  # [bytes] above which several threads are worth it
KEY = b"sha256"
"""key of the schema's metadata that holds the digest of columns and other metadata"""


def encode(table: Any, **options: Any) -> bytes:
    """A `pyarrow.Table` as the bytes of a file; the same table gives the same bytes.

    Args:
        table: its schema's metadata are kept.
        options: of `pyarrow.parquet.write_table`.
    """
    import pyarrow
    from pyarrow import parquet

    metadata = {**(table.schema.metadata or {}), KEY: digest(table).encode()}
    sink = pyarrow.BufferOutputStream()
    parquet.write_table(
        table.replace_schema_metadata(metadata),
        sink,
        compression="zstd",
        write_page_checksum=True,
        **options,
    )
    return sink.getvalue().to_pybytes()


def write(path: Path, columns: Mapping[str, Any], **options: Any) -> None:
    """Write columns; the file is whole or absent.

    Raises:
        StorageError: no space, or no permission.
    """
    import pyarrow

    files.write_bytes(path, encode(pyarrow.table(dict(columns)), **options))


def read(path: Path | str, *, most: int = reading.DATA) -> Any:
    """The `pyarrow.Table` in a file.

    Raises:
        FormatError: absent, torn, damaged, too large, or not such a file.
    """
    return decode(reading.read_bytes(path, most=most), path, most=most)


def decode(data: bytes, name: object, *, most: int = reading.DATA) -> Any:
    """The `pyarrow.Table` in the bytes of a file.

    Args:
        data: the bytes.
        name: of the file, for messages.
        most: bytes that the columns may have.

    Raises:
        FormatError: torn, damaged, too large, or not such a file.
    """
    import pyarrow

    try:
        file = opened(pyarrow.BufferReader(data), name, most=most)
        table = file.read(use_threads=len(data) > THREADS)
        table.validate()
    except (*reading.UNREADABLE, pyarrow.ArrowException) as error:
        raise unreadable(error, name) from error
    check(table, name)
    return table


def foreign(
    path: Path | str, wanted: Sequence[str], *, most: int = reading.DATA
) -> dict[str, Any]:
    """Columns of a file that another project wrote, which carries no digest.

    Args:
        path: of the file.
        wanted: names of the columns; of numbers, or of lists of equally many.
        most: bytes that the columns may have.

    Returns:
        name -> doubles, ``(N,)``, or ``(N, K)`` of lists; missing ones are NaN.

    Raises:
        FormatError: absent, torn, damaged, too large, not such a file, a column
            missing, or not of numbers.
    """
    import pyarrow

    try:
        with reading.regular(path, most=most) as source:
            file = opened(source, path, most=most)
            names = file.schema_arrow.names
            missing = [name for name in wanted if name not in names]
            if missing:
                raise FormatError(
                    f"{path} lacks the columns {_listed(missing)}; it has "
                    f"{_listed(names)}."
                )
            table = file.read(list(wanted), use_threads=False)
            return {name: plain(table.column(name), name, path) for name in wanted}
    except (*reading.UNREADABLE, pyarrow.ArrowException) as error:
        raise unreadable(error, path) from error


def plain(column: Any, name: str, path: Path | str) -> Any:
    """A column of numbers, or of lists of equally many, as doubles.

    Args:
        column: of a `pyarrow.Table`, N rows.
        name: of it, for messages.
        path: of the file, for messages.

    Returns:
        ``(N,)``, or ``(N, K)`` of lists; missing numbers are NaN.

    Raises:
        FormatError: lists of different lengths, or none at all.
        pyarrow.ArrowException: no numbers.
    """
    from pyarrow import compute, types

    kind, rows = column.type, len(column)
    if not types.is_nested(kind):
        return column.cast("float64", safe=False).fill_null(math.nan).to_numpy()
    lengths = compute.unique(compute.list_value_length(column)).to_pylist()
    if column.null_count or len(lengths) > 1:
        raise FormatError(
            f"{path}: {name} needs a list of equally many numbers in each row."
        )
    flat = compute.list_flatten(column).cast("float64", safe=False)
    values = flat.fill_null(math.nan).to_numpy()
    return values.reshape(rows, lengths[0] if lengths else 0)


def opened(source: Any, name: object, *, most: int = reading.DATA) -> Any:
    """A `pyarrow.parquet.ParquetFile` whose head was looked at.

    Args:
        source: what it is read from.
        name: of the file, for messages.
        most: bytes that the columns may have.

    Raises:
        FormatError: a column twice, or too large.
        pyarrow.ArrowException, OSError, ...: it is none (`reading.UNREADABLE`).
    """
    from pyarrow import parquet

    file = parquet.ParquetFile(
        source, page_checksum_verification=True, memory_map=False, pre_buffer=False
    )
    names = file.schema_arrow.names
    twice = sorted({name for name in names if names.count(name) > 1})
    if twice:
        raise FormatError(f"{name}: the column {twice[0]!r} is there twice.")
    rows = file.metadata.num_rows
    if not 0 <= 8 * rows * max(1, len(names)) <= most:
        raise FormatError(
            f"{name} claims {rows} rows; {reading.size(most)} is the most that is "
            "unpacked."
        )
    return file


def unreadable(error: Exception, name: object) -> FormatError:
    """The error for a file that cannot be parsed."""
    if isinstance(error, FormatError):
        return error
    return FormatError(f"{name} cannot be read as Parquet: {str(error).rstrip('.')}.")


def check(table: Any, name: object) -> None:
    """Compare a table with its digest.

    Raises:
        FormatError: it is another.
    """
    said = (table.schema.metadata or {}).get(KEY)
    if said is None:
        seal.unsealed(name)
    elif said.decode("latin-1") != digest(table):
        raise seal.damaged(name)


def digest(table: Any) -> str:
    """SHA-256 of names, types and values of all columns, and of other metadata."""
    made = hashlib.sha256()
    for key, value in sorted((table.schema.metadata or {}).items()):
        if key != KEY and not key.startswith(b"ARROW:"):
            made.update(repr((key, value)).encode())
    for name, column in zip(table.column_names, table.columns, strict=True):
        made.update(repr((name, str(column.type), len(column))).encode())
        made.update(_values(column))
    return made.hexdigest()


def _values(column: Any) -> bytes:
    """The values of a column, one way of writing each; nulls count as well."""
    import numpy as np
    import pyarrow

    if pyarrow.types.is_primitive(column.type) and not column.null_count:
        return np.ascontiguousarray(column.to_numpy()).tobytes()
    return repr(column.to_pylist()).encode()


def numbers(table: Any, wanted: Mapping[str, str], name: object) -> dict[str, Any]:
    """Columns of a table as arrays.

    Args:
        table: as read.
        wanted: name of each column that is needed, and its Arrow type.
        name: of the file, for messages.

    Raises:
        FormatError: one is missing, of another type, or has nulls.
    """
    missing = [column for column in wanted if column not in table.column_names]
    if missing:
        raise FormatError(
            f"{name} lacks the columns {_listed(missing)}; it has "
            f"{_listed(table.column_names)}."
        )
    for column, kind in wanted.items():
        found = table.column(column)
        if str(found.type) != kind or found.null_count:
            raise FormatError(
                f"{name}: column {column!r} is {found.type} with {found.null_count} "
                f"nulls, it needs {kind} without."
            )
    return {column: table.column(column).to_numpy() for column in wanted}


def _listed(names: Sequence[str]) -> str:
    return ", ".join(names)
