"""A file of JSON lines, one per event: appended to, never rewritten."""

import json
import time
from pathlib import Path
from typing import Any

from bns.storage import files


def note(path: Path, **entry: Any) -> None:
    """Append a line; its first field, `at`, is the time [s since 1970].

    Raises:
        StorageError: no space, or no permission.
    """
    line = json.dumps({"at": round(time.time(), 3), **entry}) + "\n"
    try:
        with open(path, "a", encoding="utf-8") as file:
            file.write(line)
    except OSError as error:
        raise files.storage_error(path, error) from error


def entries(path: Path) -> list[dict[str, Any]]:
    """The lines so far; a torn one is left out, no file has none."""
    if not path.exists():
        return []
    found = []
    for line in path.read_text(encoding="utf-8").splitlines():
        try:
            found.append(json.loads(line))
        except ValueError:
            continue
    return found
