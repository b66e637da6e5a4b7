"""Files that are whole or absent: written beside, synchronised, then renamed.

A journal is a file of JSON lines, one per event: appended to, never rewritten.
"""

import errno
import json
import os
import shutil
import time
from collections.abc import Callable, Mapping
from contextlib import suppress
from pathlib import Path
from typing import Any

from bns.errors import BnsError, FormatError
from bns.storage import reading, seal

TEMPORARY = ".tmp-"
"""prefix of what is not whole yet; a resumed run removes it"""

FULL = {errno.ENOSPC, errno.EDQUOT, errno.EFBIG}


class StorageError(BnsError):
    """A file could not be written; what was there before is untouched."""


def storage_error(path: Path, error: OSError) -> StorageError:
    """The message for a failed write of `path`."""
    if error.errno in FULL:
        return StorageError(
            f"No space left to write {path}: what was written before stays readable. "
            "Free some space, then repeat the command, a run or campaign with --resume."
        )
    return StorageError(
        f"Cannot write {path}: {error.strerror}. Give a directory that can be written."
    )


def check_writable(path: Path | str) -> None:
    """Stop before long work whose result could not be written.

    Raises:
        StorageError: `path` is no file, or its directory is missing or read-only.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise StorageError(f"{path} is there and is no file: give another name.")
    temporary = path.with_name(f"{TEMPORARY}{os.getpid()}-{path.name}")
    try:
        temporary.touch()
    except OSError as error:
        raise storage_error(path, error) from error
    finally:
        remove(temporary)


def make_directory(path: Path) -> None:
    """Create a directory and its parents.

    Raises:
        StorageError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise storage_error(path, error) from error


def write_bytes(path: Path | str, data: bytes) -> None:
    """Write a file so that it is whole or absent at every moment.

    Raises:
        StorageError: no space, or no permission.
    """
    replace(path, lambda temporary: temporary.write_bytes(data))


def write_text(path: Path | str, text: str) -> None:
    """Write a text file in UTF-8 likewise.

    Raises:
        StorageError: no space, or no permission.
    """
    write_bytes(path, text.encode())


def replace(path: Path | str, write: Callable[[Path], object]) -> None:
    """Let `write` make a file or directory beside `path`, then move it there.

    What was at `path` stays until all of the new is on the disk, and stays if `write`
    fails. A directory is moved only where `path` is absent.

    Args:
        path: of the file; a link is followed.
        write: given where to write; the name ends as that of `path`.

    Raises:
        StorageError: no space, no permission, or `path` is a device or a pipe.
    """
    path = Path(os.path.realpath(path))
    if path.exists() and not path.is_file():
        raise StorageError(f"{path} is there and is no file: give another name.")
    temporary = path.with_name(f"{TEMPORARY}{os.getpid()}-{path.name}")
    try:
        _remove(temporary)
        write(temporary)
        _sync(temporary)
        os.replace(temporary, path)
        _sync_directory(path.parent)
    except OSError as error:
        raise storage_error(path, error) from error
    finally:
        remove(temporary)


def remove_temporary(directory: Path) -> None:
    """Remove what a killed writer left half-written in `directory`."""
    for path in directory.glob(f"{TEMPORARY}*"):
        _remove(path)


def remove_tree(path: Path) -> None:
    """Remove a directory, if it is there."""
    shutil.rmtree(path, ignore_errors=True)


def write_json(path: Path | str, content: Mapping[str, Any]) -> None:
    """Write JSON, keys in the order given, and the digest of it (`bns.storage.seal`).

    Raises:
        StorageError: no space, or no permission.
    """
    sealed = seal.sealed(content)
    text = json.dumps(sealed, indent=2, allow_nan=False, ensure_ascii=False)
    write_text(path, text + "\n")


def remove(path: Path) -> None:
    """Remove a file or a directory, if it is there; what cannot be removed stays."""
    with suppress(OSError):
        _remove(path)


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        remove_tree(path)
    else:
        path.unlink(missing_ok=True)


def _sync(path: Path) -> None:
    """Bring a file, or all files of a directory, to the disk."""
    if not path.is_dir():
        _flush(path, os.O_RDWR)
        return
    for below in path.iterdir():
        _sync(below)
    _sync_directory(path)


def _sync_directory(path: Path) -> None:
    if os.name == "posix":  # elsewhere a directory cannot be opened
        _flush(path, os.O_RDONLY)


def _flush(path: Path, flags: int) -> None:
    handle = os.open(path, flags)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)


def append_entry(path: Path, **entry: Any) -> None:
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
        raise storage_error(path, error) from error


def read_entries(path: Path) -> list[dict[str, Any]]:
    """The lines so far; a torn one is left out, no file has none."""
    if not path.exists():
        return []
    found = []
    for line in reading.read_bytes(path, most=reading.DATA).splitlines():
        with suppress(FormatError):
            entry = reading.json(line, path)
            found += [entry] if isinstance(entry, dict) else []
    return found
