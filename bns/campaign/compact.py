"""results.parquet: all batches of a campaign in one file, a row group each."""

import json
import os
from collections.abc import Sequence
from pathlib import Path
from typing import Any

from bns.campaign.part import META, Part, from_table
from bns.errors import FormatError
from bns.storage import files

FORMAT, SCHEMA = "bns-campaign", 1
RESULTS = "results.parquet"


class Compact:
    """The file as it was when it was opened, even if it is replaced meanwhile.

    Args:
        directory: of the campaign; without the file there are no batches.

    Raises:
        FormatError: damaged, or of a newer version.
    """

    def __init__(self, directory: Path):
        import pyarrow as pa
        import pyarrow.parquet as pq

        self.path = directory / RESULTS
        self.parts: dict[str, tuple[dict[str, Any], int]] = {}
        try:
            self.file = pq.ParquetFile(self.path)
            head = json.loads((self.file.schema_arrow.metadata or {})[META])
            parts, schema = head["parts"], int(head["schema"])
        except FileNotFoundError:
            return
        except (pa.ArrowException, OSError, KeyError, ValueError) as error:
            raise FormatError(f"{self.path} cannot be read: {error}.") from error
        if schema > SCHEMA:
            raise FormatError(
                f"{self.path} has schema {schema}, this version reads up to {SCHEMA}: "
                "install a newer bns. Nothing was changed."
            )
        self.parts = {part["key"]: (part, index) for index, part in enumerate(parts)}

    def read(self, key: str) -> Part:
        """A batch of it."""
        head, index = self.parts[key]
        table = self.file.read_row_group(index)
        return from_table(head, table, f"{key} in {self.path}")


def write(directory: Path, parts: Sequence[Part]) -> None:
    """Replace the file by one with these batches, in this order.

    Raises:
        StorageError: no space, or no permission.
    """
    import pyarrow as pa
    import pyarrow.parquet as pq

    tables = [part.table() for part in parts]
    schema = pa.unify_schemas([table.schema for table in tables])
    content = {
        "format": FORMAT,
        "schema": SCHEMA,
        "parts": [part.head() for part in parts],
    }
    text = json.dumps(content, separators=(",", ":"))
    schema = schema.with_metadata({META: text.encode()})

    def write(path: Path) -> None:
        with pq.ParquetWriter(path, schema, compression="zstd") as writer:
            for table in tables:
                rows = max(1, table.num_rows)
                writer.write_table(_fitted(table, schema), row_group_size=rows)
        with open(path, "rb") as file:
            os.fsync(file.fileno())

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
