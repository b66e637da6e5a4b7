"""The per-trial figures of a run as Parquet: a row per replicate and trial."""

from collections.abc import Mapping
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.storage import files

KEYS = ("replicate", "trial")


def write_table(path: Path, columns: Mapping[str, np.ndarray]) -> None:
    """Write columns of shape ``(R, T)``; the same columns give the same bytes.

    Raises:
        StorageError: no space, or no permission.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    runs, trials = np.indices(next(iter(columns.values())).shape)
    table = {"replicate": runs, "trial": trials} | dict(columns)
    flat = pa.table({name: pa.array(array.ravel()) for name, array in table.items()})
    sink = pa.BufferOutputStream()
    pq.write_table(flat, sink, compression="zstd")
    files.write_bytes(path, sink.getvalue().to_pybytes())


def read_table(path: Path) -> dict[str, np.ndarray]:
    """Read what `write_table` wrote, each column ``(R, T)``.

    Raises:
        FormatError: absent, torn, or not such a table.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(path)
        columns = {name: table[name].to_numpy() for name in table.column_names}
        runs, trials = (int(columns.pop(key).max()) + 1 for key in KEYS)
        return {n: array.reshape(runs, trials) for n, array in columns.items()}
    except (OSError, pa.ArrowException, KeyError, ValueError) as error:
        raise FormatError(f"{path} cannot be read: {error}.") from error
