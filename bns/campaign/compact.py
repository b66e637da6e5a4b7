"""results.parquet: all batches of a campaign in one file, a row group each."""

import json
from collections.abc import Sequence
from pathlib import Path
from typing import Any

import msgspec

from bns.campaign.part import META, Part, content, from_table
from bns.errors import FormatError
from bns.storage import files, parquet, reading, seal

FORMAT, SCHEMA = "bns-campaign", 1
RESULTS = "results.parquet"
DIGEST = "table_sha256"
"""key of a part's head that holds the digest of its figures"""


class Head(msgspec.Struct):
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
        if head.get("format") != FORMAT or type(schema) is not int:
            raise FormatError(f"{self.path} is no file of a campaign's results.")
        if schema > SCHEMA:
            raise FormatError(
                f"{self.path} has schema {schema}, this version reads up to {SCHEMA}: "
                "install a newer bns. Nothing was changed."
            )
        said = reading.typed(seal.opened(head, self.path), Head, self.path)
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


def write(directory: Path, parts: Sequence[Part]) -> None:
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
    head = seal.sealed({"format": FORMAT, "schema": SCHEMA, "parts": heads})
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
