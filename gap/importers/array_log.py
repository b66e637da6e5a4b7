"""Arrays under names, one a column: Parquet tables and NPZ archives.

A list of numbers in each row, or an array of two dimensions, becomes a column per
number: `q` of three gives `q0`, `q1`, `q2`. Text and what is of another length is left
out. HDF5 and MATLAB files are not read; `other_files.advice` says what makes a table of
one.
"""

from collections import Counter
from collections.abc import Iterator, Mapping
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import FormatError
from bns.gap.importers.tables import Column, Table, moments
from bns.storage import arrays, parquet, reading
from bns.storage.tables import is_number

INDEX = "__index_level_0__"  # rows of a data frame, numbered


def read(path: Path) -> Table:
    """The numbers in a table.

    Args:
        path: of a Parquet file (`.parquet`, `.pq`) or an NPZ archive.

    Raises:
        FormatError: not there, damaged, too large, or without two columns of numbers.
    """
    packed = path.suffix.lower() == ".npz"
    found = arrays.read_npz(path) if packed else _frame(path)
    able = {name: a for name, a in found.items() if _is_column(a)}
    rows = Counter(len(values) for values in able.values())
    count = max(rows, key=lambda each: (rows[each], each), default=0)
    kept = {name: values for name, values in able.items() if len(values) == count}
    columns = [each for item in kept.items() for each in _columns(*item)]
    if len(columns) < 2:
        listed = ", ".join(f"{name} {values.shape}" for name, values in found.items())
        raise FormatError(
            f"{path} is no table: a log has arrays of numbers of one length, one a "
            f"column; it has {listed or 'none'}."
        )
    left = [name for name in found if name not in kept]
    notes = (f"left out, not {count} numbers: {', '.join(left)}",) * bool(left)
    return Table(tuple(columns), "NPZ archive" if packed else "Parquet table", notes)


def _is_column(values: np.ndarray) -> bool:
    """Whether an array is of numbers, one or several for each row."""
    return values.dtype.kind in "biuf" and values.ndim in (1, 2) and values.size > 0


def _columns(name: str, values: np.ndarray) -> Iterator[Column]:
    values = values.astype(float)
    if values.ndim == 1 or values.shape[1] == 1:
        yield Column(name, values.reshape(len(values)))
        return
    for at, each in enumerate(values.T):
        yield Column(f"{name}{at}", each)


def _frame(path: Path) -> Mapping[str, Any]:
    """Columns of a Parquet file; moments are seconds."""
    import pyarrow

    try:
        with reading.regular(path, most=reading.DATA) as source:
            file = parquet.opened(source, path)
            table = file.read(use_threads=False)
            names = [name for name in table.column_names if name != INDEX]
            whole = {name: table.column(name) for name in names}
            seconds = moments(whole)
            return {
                name: seconds[name] if name in seconds else _numbers(column, name, path)
                for name, column in whole.items()
            }
    except (*reading.UNREADABLE, pyarrow.ArrowException) as error:
        raise parquet.unreadable(error, path) from error


def _numbers(column: Any, name: str, path: Path) -> np.ndarray:
    """A column of numbers or of lists of them; of anything else an empty array."""
    from pyarrow import types

    kind = column.type
    inner = getattr(kind, "value_type", kind)
    if types.is_boolean(inner) or is_number(inner):
        made: np.ndarray = parquet.plain(column, name, path)
        return made
    return np.zeros((0, 0, 0))
