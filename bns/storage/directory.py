"""Whether a directory is free for a run, or is one."""

from pathlib import Path
from typing import Any

from bns.errors import BnsError, FormatError
from bns.storage import files, reading, seal

FORMAT = "bns-run"
SCHEMA = 1


def check_free(directory: Path) -> None:
    """Refuse a directory that holds anything.

    Raises:
        BnsError: it holds a run (go on with --resume) or something else.
    """
    if not directory.exists():
        return
    if not directory.is_dir():
        raise BnsError(f"{directory} is a file: give another --out.")
    held = [p.name for p in directory.iterdir() if not _harmless(p.name)]
    if "run.json" in held:
        raise BnsError(
            f"{directory} holds a run already: add --resume to go on with it, "
            "or give another --out."
        )
    if held:
        raise FormatError(
            f"{directory} is not empty and holds no run ({min(held)}, ...): "
            "give another --out. Nothing was changed."
        )


def _harmless(name: str) -> bool:
    """What a run killed before its first whole file leaves behind."""
    return name.startswith(files.TEMPORARY) or name in ("config.toml", "faults.jsonl")


def read_head(
    path: Path, *, kind: str = "run", format: str = FORMAT, schema: int = SCHEMA
) -> dict[str, Any]:
    """The content of the file that says what a directory holds.

    Args:
        path: of the file.
        kind: of directory, "run" or "campaign".
        format: name that the file must state.
        schema: newest that can be read.

    Raises:
        FormatError: no such directory, damaged, or written by a newer version.
    """
    made = {"run": "bns run", "campaign": "bns campaign run"}[kind]
    if not path.exists():
        raise FormatError(
            f"{path.parent} is not a {kind} directory (it has no {path.name}): "
            f"give one that `{made}` made. Nothing was changed."
        )
    head = seal.opened(reading.read_json(path), path)
    if head.get("format") != format or type(head.get("schema")) is not int:
        raise FormatError(f"{path} is not a {kind} of bns. Nothing was changed.")
    if head["schema"] > schema:
        raise FormatError(
            f"{path} has schema {head['schema']}, this version reads up to {schema}: "
            "install a newer bns. Nothing was changed."
        )
    return head
