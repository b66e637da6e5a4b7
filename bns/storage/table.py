"""The per-trial figures of a run as Parquet: a row per replicate and trial."""

import math
from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.storage import parquet

KEYS = ("replicate", "trial")


def write_table(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of shape ``(R, T)``; the same columns give the same bytes.

    Raises:
        StorageError: no space, or no permission.
    """
    runs, trials = np.indices(next(iter(columns.values())).shape)
    table = {"replicate": runs, "trial": trials} | dict(columns)
    parquet.write(path, {name: array.ravel() for name, array in table.items()})


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Read what `write_table` wrote, each column ``(R, T)``.

    Raises:
        FormatError: absent, torn, damaged, or not such a table.
    """
    table = parquet.read(path)
    kinds = dict.fromkeys(table.column_names, "double") | dict.fromkeys(KEYS, "int64")
    columns = parquet.numbers(table, kinds, path)
    shape = tuple(int(columns[key].max(initial=-1)) + 1 for key in KEYS)
    if math.prod(shape) != table.num_rows:  # nothing is made for numbers so large
        raise FormatError(
            f"{path}: {' x '.join(map(str, shape))} replicates and trials in "
            f"{table.num_rows} rows."
        )
    for key, index in zip(KEYS, np.indices(shape), strict=True):
        if not np.array_equal(columns.pop(key), index.ravel()):
            raise FormatError(
                f"{path}: {key} does not count up over the {table.num_rows} rows."
            )
    return {name: array.reshape(shape) for name, array in columns.items()}
