"""The results of one batch as the bytes of a Parquet file.

A row per configuration, replicate and trial; the file's metadata says what ran. The
same batch gives the same bytes, on every engine (same machine type, versions, mode).
"""

import json
from collections.abc import Mapping
from dataclasses import dataclass
from typing import Annotated, Any

import msgspec
import numpy as np

from bns.campaign.identity import foreign
from bns.errors import BnsError, FormatError
from bns.experiment.config import RunConfig
from bns.experiment.loading import from_mapping, to_mapping
from bns.experiment.record import RunRecord
from bns.storage import parquet, reading

FORMAT, SCHEMA = "bns-campaign-part", 1
META = b"bns"
KEYS = ("config", "replicate", "trial")


Count = Annotated[int, msgspec.Meta(ge=-1, le=1_000_000_000)]


class Entry(msgspec.Struct):
    """What a head says of a block."""

    identity: str
    start: Annotated[int, msgspec.Meta(ge=0, le=1_000_000_000)]
    onset: Count
    config: dict[str, Any]


class Head(msgspec.Struct):
    """What is said of a part, beside its format and schema."""

    key: str
    facts: dict[str, Any]
    blocks: list[Entry]


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
    text = json.dumps(part.head(), separators=(",", ":"))
    return parquet.encode(part.table().replace_schema_metadata({META: text.encode()}))


def decode(data: bytes, name: str) -> Part:
    """The part in the bytes of a file.

    Args:
        data: the bytes.
        name: of the file, for messages.

    Raises:
        FormatError: not such a file, torn, damaged, or of a newer version.
    """
    table = parquet.decode(data, name)
    return from_table(content(table.schema, name), table, name)


def content(schema: Any, name: object) -> dict[str, Any]:
    """What a file's schema says of the figures in it.

    Raises:
        FormatError: nothing.
    """
    found = reading.json((schema.metadata or {}).get(META, b"null"), name)
    if not isinstance(found, dict):
        raise FormatError(f"{name} is no file of a campaign.")
    return found


def from_table(head: Mapping[str, Any], table: Any, name: str) -> Part:
    """The part of a head and its figures.

    Args:
        head: what is said of the part: format, schema, key, facts, blocks.
        table: Arrow table of the figures, a row per replicate and trial, block after
            block.
        name: of the file, for messages.

    Raises:
        FormatError: they are not of this format, of a newer version, or rows are
            missing or too many.
    """
    if head.get("format") != FORMAT or type(head.get("schema")) is not int:
        raise FormatError(f"{name} is no part of a campaign.")
    if head["schema"] > SCHEMA:
        raise FormatError(
            f"{name} has schema {head['schema']}, this version reads up to {SCHEMA}: "
            "install a newer bns. Nothing was changed."
        )
    said = reading.typed(head, Head, name)
    figures = [
        column
        for column in table.column_names
        if column not in KEYS and table[column].null_count < table.num_rows
    ]
    arrays = parquet.numbers(table, dict.fromkeys(figures, "double"), name)
    blocks, at = [], 0
    for entry in said.blocks:
        try:
            config = from_mapping(entry.config)
        except BnsError as error:
            raise FormatError(f"{name} cannot be used: {error}") from error
        shape = (config.replicates, config.trials)
        rows = slice(at, at + shape[0] * shape[1])
        at = rows.stop
        if at > table.num_rows:
            break
        columns = {n: values[rows].reshape(shape) for n, values in arrays.items()}
        made = Block(entry.identity, config, entry.start, entry.onset, columns)
        blocks.append(made)
    if at != table.num_rows or not figures:
        raise FormatError(
            f"{name} is not whole: it holds {table.num_rows} rows and {len(figures)} "
            f"figures, {at} rows are listed."
        )
    return Part(said.key, tuple(blocks), said.facts)
