"""Checksums inside files, so that one flipped bit is noticed.

JSON objects carry a key `sha256`, the digest of everything else in them; TOML files a
first line `# sha256: ...`, of the lines after it. What has none was written by hand or
by an older version: it is read, with a warning. Who edits such a file by hand takes the
key, or the line, out.
"""

import hashlib
import logging
from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

import msgspec

from bns.errors import FormatError

log = logging.getLogger(__name__)

KEY = "sha256"
_LINE = f"# {KEY}: "


def digest(data: bytes) -> str:
    """The SHA-256 of bytes, in hexadecimal."""
    return hashlib.sha256(data).hexdigest()


def sealed(content: Mapping[str, Any]) -> dict[str, Any]:
    """An object ready for JSON, with the digest of its content."""
    rest = {key: value for key, value in content.items() if key != KEY}
    return {**rest, KEY: _digest(rest)}


def opened(content: Mapping[str, Any], name: object) -> dict[str, Any]:
    """An object as read from JSON without its digest, which is compared.

    Raises:
        FormatError: the digest is another.
    """
    rest = {key: value for key, value in content.items() if key != KEY}
    if KEY not in content:
        unsealed(name)
    elif content[KEY] != _digest(rest):
        raise damaged(name, f"its key {KEY!r}")
    return rest


def sealed_text(text: str) -> str:
    """TOML text with the digest in a line before it."""
    return f"{_LINE}{digest(text.encode())}\n{text}"


def opened_text(text: str, name: object, *, wanted: bool = True) -> str:
    """TOML text without the line of its digest, which is compared.

    Args:
        text: of the file.
        name: of the file, for messages.
        wanted: warn where there is no such line.

    Raises:
        FormatError: the digest is another.
    """
    if not text.startswith(_LINE):
        if wanted:
            unsealed(name)
        return text
    said, _, rest = text.removeprefix(_LINE).partition("\n")
    if said.strip() != digest(rest.encode()):
        raise damaged(name, "its first line")
    return rest


def damaged(name: object, place: str = "") -> FormatError:
    """The error for a file whose digest is another."""
    edited = f" If it was edited by hand, take out {place}." if place else ""
    return FormatError(
        f"{name} is damaged: its content has another checksum than when it was "
        f"written. Take it from a backup, or make it anew.{edited}"
    )


def unsealed(name: object) -> None:
    """Warn of a file that carries no digest, once for all files of its directory."""
    _warn(Path(str(name)).parent)


@cache
def _warn(directory: Path) -> None:
    log.warning(
        "A file in %s carries no checksum: it is read as it is, as are others there.",
        directory,
    )


def _digest(content: Mapping[str, Any]) -> str:
    plain = msgspec.json.decode(msgspec.json.encode(content))  # as it will be read
    return digest(msgspec.json.encode(plain, order="deterministic"))
