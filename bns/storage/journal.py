"""A file of JSON lines, one per event: appended to, never rewritten."""

import json
import os
import time
from contextlib import suppress
from pathlib import Path
from typing import Any

from bns.errors import FormatError
from bns.storage import files, reading


def note(path: Path, **entry: Any) -> None:
    """Append a line; its first field, `at`, is the time [s since 1970].

    Raises:
        StorageError: no space, or no permission.
    """
    line = json.dumps({"at": round(time.time(), 3), **entry}) + "\n"
    try:
        with open(path, "ab+") as file:
            if file.tell() and file.seek(-1, os.SEEK_END) >= 0 and file.read() != b"\n":
                line = "\n" + line  # the last one is torn
            file.write(line.encode())
    except OSError as error:
        raise files.storage_error(path, error) from error


def entries(path: Path) -> list[dict[str, Any]]:
    """The lines so far; a torn one is left out, no file has none."""
    if not path.exists():
        return []
    found = []
    for line in reading.read_bytes(path, most=reading.DATA).splitlines():
        with suppress(FormatError):
            entry = reading.json(line, path)
            found += [entry] if isinstance(entry, dict) else []
    return found
