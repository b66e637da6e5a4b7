"""The results of one batch as the bytes of a Parquet file.

A row per configuration, replicate and trial; the file's metadata says what ran. The
same batch gives the same bytes, on every engine (same machine type, versions, mode).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Any

import numpy as np

from bns.campaign.identity import foreign
from bns.errors import BnsError, FormatError
from bns.experiment.config import RunConfig
from bns.experiment.loading import from_mapping, to_mapping
from bns.experiment.record import RunRecord

FORMAT, SCHEMA = "bns-campaign-part", 1
META = b"bns"
KEYS = ("config", "replicate", "trial")


@dataclass(frozen=True, eq=False)
class Block:
    """Consecutive replicates of one configuration.

    Attributes:
        identity: of the configuration.
        config: all of it; its `replicates` are those of this block.
        start: number of the first replicate.
        onset: first damaged trial, -1 = none.
        columns: per-trial figures of `RunRecord`, each ``(R, T)``.
    """

    identity: str
    config: RunConfig
    start: int
    onset: int
    columns: Mapping[str, np.ndarray]

    @property
    def count(self) -> int:
        """Replicates in it."""
        return self.config.replicates

    def record(self) -> RunRecord:
        """As the record of a run, without commands and poses."""
        shape = next(iter(self.columns.values())).shape
        empty = np.zeros((*shape, 0, 3))
        return RunRecord(
            config=self.config,
            versions={},
            columns=dict(self.columns),
            sent=empty,
            poses=empty,
            predicted=empty,
            damage_onset=np.full(shape[0], self.onset, np.int64),
        )


@dataclass(frozen=True, eq=False)
class Part:
    """One batch that is done.

    Attributes:
        key: of the batch.
        blocks: what is in it.
        facts: what ran: seeds, mode, versions.
    """

    key: str
    blocks: tuple[Block, ...]
    facts: Mapping[str, Any]

    def head(self) -> dict[str, Any]:
        """Everything but the figures, ready for JSON."""
        return {
            "format": FORMAT,
            "schema": SCHEMA,
            "key": self.key,
            "facts": dict(self.facts),
            "blocks": [
                {
                    "identity": block.identity,
                    "start": block.start,
                    "onset": block.onset,
                    "config": _mapping(block.config),
                }
                for block in self.blocks
            ],
        }

    def table(self) -> Any:
        """The figures as an Arrow table."""
        import pyarrow as pa

        names: list[str] = []
        for block in self.blocks:
            names += [name for name in block.columns if name not in names]
        tables = []
        for block in self.blocks:
            runs, trials = np.indices(next(iter(block.columns.values())).shape)
            columns = {
                "config": [block.identity] * runs.size,
                "replicate": (runs + block.start).ravel().astype(np.int32),
                "trial": trials.ravel().astype(np.int32),
            }
            none = np.full(runs.shape, np.nan)
            for name in names:
                columns[name] = block.columns.get(name, none).ravel().astype(float)
            tables.append(pa.table(columns))
        return pa.concat_tables(tables)


def _mapping(config: RunConfig) -> dict[str, Any]:
    """A configuration without what belongs to other tasks and learners."""
    others = foreign(config)
    return {
        key: value for key, value in to_mapping(config).items() if key not in others
    }


def encode(part: Part) -> bytes:
    """The bytes of a part."""
    import pyarrow as pa
    import pyarrow.parquet as pq

    text = json.dumps(part.head(), separators=(",", ":"))
    table = part.table().replace_schema_metadata({META: text.encode()})
    sink = pa.BufferOutputStream()
    pq.write_table(table, sink, compression="zstd")
    return sink.getvalue().to_pybytes()


def decode(data: bytes, name: str) -> Part:
    """The part in the bytes of a file.

    Args:
        data: the bytes.
        name: of the file, for messages.

    Raises:
        FormatError: not such a file, torn, or of a newer version.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    try:
        table = pq.read_table(pa.BufferReader(data))
        head = json.loads((table.schema.metadata or {})[META])
    except (pa.ArrowException, OSError, KeyError, ValueError) as error:
        raise FormatError(f"{name} cannot be read: {error}.") from error
    return from_table(head, table, name)


def from_table(head: Mapping[str, Any], table: Any, name: str) -> Part:
    """The part of a head and its figures.

    Raises:
        FormatError: they are not of this format, or of a newer version.
    """
    if head.get("format") != FORMAT or type(head.get("schema")) is not int:
        raise FormatError(f"{name} is no part of a campaign.")
    if head["schema"] > SCHEMA:
        raise FormatError(
            f"{name} has schema {head['schema']}, this version reads up to {SCHEMA}: "
            "install a newer bns. Nothing was changed."
        )
    figures = [
        name
        for name in table.column_names
        if name not in KEYS and table[name].null_count < table.num_rows
    ]
    arrays = {column: table[column].to_numpy() for column in figures}
    blocks, at = [], 0
    try:
        for entry in head["blocks"]:
            config = from_mapping(entry["config"])
            shape = (config.replicates, config.trials)
            rows = slice(at, at + shape[0] * shape[1])
            at = rows.stop
            columns = {n: values[rows].reshape(shape) for n, values in arrays.items()}
            blocks.append(
                Block(
                    entry["identity"], config, entry["start"], entry["onset"], columns
                )
            )
        return Part(head["key"], tuple(blocks), head["facts"])
    except (KeyError, TypeError, ValueError) as error:
        if isinstance(error, BnsError):
            raise FormatError(f"{name} cannot be used: {error}") from error
        raise FormatError(f"{name} is not whole: {error}.") from error
