"""The results of batches: a Parquet file of one, and one of all of a campaign.

A batch has a row per configuration, replicate and trial; the file's metadata says what
ran. The same batch gives the same bytes, on every engine (same machine type, versions,
mode). `results.parquet` holds all batches of a campaign, a row group each.
"""

import json
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any

import msgspec
import numpy as np

from bns.campaign.identity import foreign
from bns.errors import BnsError, FormatError
from bns.experiment.config import RunConfig
from bns.experiment.loading import from_mapping, to_mapping
from bns.experiment.record import RunRecord
from bns.storage import files, parquet, reading, seal

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


RESULTS_FORMAT, RESULTS_SCHEMA = "bns-campaign", 1
RESULTS = "results.parquet"
DIGEST = "table_sha256"
"""key of a part's head that holds the digest of its figures"""


class ResultsHead(msgspec.Struct):
    """What results.parquet says of its parts, beside format and schema."""

    parts: list[dict[str, Any]]


class Compact:
    """The file as it was when it was opened, even if it is replaced meanwhile.

    Args:
        directory: of the campaign; without the file there are no batches.

    Raises:
        FormatError: damaged, or of a newer version.
    """

    def __init__(self, directory: Path):
        import pyarrow as pa

        self.path = directory / RESULTS
        self.parts: dict[str, tuple[dict[str, Any], int]] = {}
        if not self.path.exists():
            return
        try:
            self.file = parquet.opened(self._source(), self.path)
        except (*reading.UNREADABLE, pa.ArrowException) as error:
            raise parquet.unreadable(error, self.path) from error
        head = content(self.file.schema_arrow, self.path)
        schema = head.get("schema")
        if head.get("format") != RESULTS_FORMAT or type(schema) is not int:
            raise FormatError(f"{self.path} is no file of a campaign's results.")
        if schema > RESULTS_SCHEMA:
            raise FormatError(
                f"{self.path} has schema {schema}, this version reads up to "
                f"{RESULTS_SCHEMA}: install a newer bns. Nothing was changed."
            )
        said = reading.typed(seal.opened(head, self.path), ResultsHead, self.path)
        if len(said.parts) != self.file.num_row_groups:
            raise FormatError(
                f"{self.path} lists {len(said.parts)} parts, holds others."
            )
        places = enumerate(said.parts)
        self.parts = {str(part.get("key")): (part, at) for at, part in places}

    def _source(self) -> Any:
        """The file, open; one that is replaced meanwhile stays readable."""
        import pyarrow as pa

        with reading.regular(self.path):
            return pa.OSFile(str(self.path))

    def read(self, key: str) -> Part:
        """A batch of it.

        Raises:
            FormatError: it is damaged.
        """
        import pyarrow as pa

        head, index = self.parts[key]
        name = f"{key} in {self.path}"
        try:
            table = self.file.read_row_group(index).replace_schema_metadata(None)
        except (*reading.UNREADABLE, pa.ArrowException) as error:
            raise parquet.unreadable(error, name) from error
        said = head.get(DIGEST)
        if said is None:
            seal.unsealed(self.path)
        elif said != parquet.digest(table):
            raise seal.damaged(name)
        return from_table(head, table, name)


def write_results(directory: Path, parts: Sequence[Part]) -> None:
    """Replace the file by one with these batches, in this order.

    Raises:
        StorageError: no space, or no permission.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    made = [part.table() for part in parts]
    schema = pa.unify_schemas([table.schema for table in made])
    tables = [_fitted(table, schema) for table in made]
    heads = [
        {**part.head(), DIGEST: parquet.digest(table)}
        for part, table in zip(parts, tables, strict=True)
    ]
    head = seal.sealed(
        {"format": RESULTS_FORMAT, "schema": RESULTS_SCHEMA, "parts": heads}
    )
    text = json.dumps(head, separators=(",", ":"))
    schema = schema.with_metadata({META: text.encode()})
    options: dict[str, Any] = {"compression": "zstd", "write_page_checksum": True}

    def write(path: Path) -> None:
        """Write all batches into a file."""
        with pq.ParquetWriter(path, schema, **options) as writer:
            for table in tables:
                writer.write_table(
                    table.replace_schema_metadata(schema.metadata),
                    row_group_size=max(1, table.num_rows),
                )

    files.replace(directory / RESULTS, write)


def _fitted(table: Any, schema: Any) -> Any:
    """A table with all columns of a schema; what is missing is null."""
    import pyarrow as pa

    columns = [
        table[field.name]
        if field.name in table.column_names
        else pa.nulls(table.num_rows, field.type)
        for field in schema
    ]
    return pa.table(columns, schema=schema)
