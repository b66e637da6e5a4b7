"""Files that are whole or absent: written beside, synchronised, then renamed."""

import errno
import io
import json
import os
import shutil
from collections.abc import Callable, Mapping
from pathlib import Path
from typing import Any
from zipfile import BadZipFile

import numpy as np

from bns.errors import BnsError, FormatError

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
            "Free some space, then repeat the command with --resume."
        )
    return StorageError(
        f"Cannot write {path}: {error.strerror}. Give a directory that can be written."
    )


def make_directory(path: Path) -> None:
    """Create a directory and its parents.

    Raises:
        StorageError: it cannot be made.
    """
    try:
        path.mkdir(parents=True, exist_ok=True)
    except OSError as error:
        raise storage_error(path, error) from error


def write_bytes(path: Path, data: bytes) -> None:
    """Write a file so that it is whole or absent at every moment.

    Raises:
        StorageError: no space, or no permission.
    """

    def write(temporary: Path) -> None:
        with open(temporary, "wb") as file:
            file.write(data)
            file.flush()
            os.fsync(file.fileno())

    replace(path, write)


def replace(path: Path, write: Callable[[Path], None]) -> None:
    """Let `write` make a file or directory beside `path`, then move it there.

    A directory is moved only where `path` is absent.

    Raises:
        StorageError: no space, or no permission.
    """
    temporary = path.with_name(f"{TEMPORARY}{path.name}")
    try:
        _remove(temporary)
        write(temporary)
        os.replace(temporary, path)
        _sync_directory(path.parent)
    except OSError as error:
        _remove(temporary)
        raise storage_error(path, error) from error


def remove_temporary(directory: Path) -> None:
    """Remove what a killed writer left half-written in `directory`."""
    for path in directory.glob(f"{TEMPORARY}*"):
        _remove(path)


def remove_tree(path: Path) -> None:
    """Remove a directory, if it is there."""
    shutil.rmtree(path, ignore_errors=True)


def write_json(path: Path, content: Mapping[str, Any]) -> None:
    """Write JSON, keys in the order given."""
    text = json.dumps(content, indent=2, allow_nan=False, ensure_ascii=False)
    write_bytes(path, (text + "\n").encode())


def read_json(path: Path) -> dict[str, Any]:
    """Read a JSON object.

    Raises:
        FormatError: absent, torn, or not an object.
    """
    try:
        content = json.loads(path.read_bytes())
    except (OSError, ValueError) as error:
        raise FormatError(f"{path} cannot be read as JSON: {error}.") from error
    if not isinstance(content, dict):
        raise FormatError(f"{path} holds no JSON object.")
    return content


def write_npz(
    path: Path, arrays: Mapping[str, np.ndarray], *, compressed: bool = False
) -> None:
    """Write arrays without pickle; the same arrays give the same bytes.

    Raises:
        TypeError: an array holds Python objects.
        StorageError: no space, or no permission.
    """
    objects = [name for name, array in arrays.items() if np.asarray(array).dtype == "O"]
    if objects:
        raise TypeError(f"arrays of Python objects cannot be stored: {objects}")
    buffer = io.BytesIO()
    (np.savez_compressed if compressed else np.savez)(buffer, **arrays)
    write_bytes(path, buffer.getvalue())


def read_npz(path: Path) -> dict[str, np.ndarray]:
    """Read arrays, never pickled ones.

    Raises:
        FormatError: absent, torn, or not such a file.
    """
    try:
        with np.load(path, allow_pickle=False) as content:
            return {name: content[name] for name in content.files}
    except (OSError, ValueError, EOFError, BadZipFile, AttributeError) as error:
        raise FormatError(f"{path} cannot be read: {error}.") from error


def _remove(path: Path) -> None:
    if path.is_dir() and not path.is_symlink():
        remove_tree(path)
    else:
        path.unlink(missing_ok=True)


def _sync_directory(path: Path) -> None:
    if os.name != "posix":  # elsewhere a directory cannot be opened
        return
    handle = os.open(path, os.O_RDONLY)
    try:
        os.fsync(handle)
    finally:
        os.close(handle)
