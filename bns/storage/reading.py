"""Files from outside: regular, of a size that is told, parsed once, then typed.

Every reader of the project comes through here (arrays and tables through `arrays`,
`parquet` and `tables` beside it). Whatever a file holds, what comes out is its
content or a `FormatError` of one line.
"""

import gzip
import os
import re
import stat
import tomllib
import zlib
from collections.abc import Iterator, Mapping
from contextlib import contextmanager
from pathlib import Path
from typing import Annotated, Any, BinaryIO, TypeVar

import msgspec

from bns.errors import FormatError

BEYOND = 1e9

Finite = Annotated[float, msgspec.Meta(ge=-BEYOND, le=BEYOND)]
"""any number; NaN and infinity are none"""

Positive = Annotated[float, msgspec.Meta(ge=1 / BEYOND, le=BEYOND)]
Least = Annotated[float, msgspec.Meta(ge=0, le=BEYOND)]
Name = Annotated[str, msgspec.Meta(min_length=1, max_length=200)]


TEXT = 16 << 20  # [bytes] descriptions, settings, heads
DATA = 4 << 30  # [bytes] recordings, arrays and tables; unpacked as well
DEEPEST = 64  # tables and lists in one another
_CHAIN = re.compile(r"(?<![\w\"'-])(?:[\w\"'-]++[ \t]*+\.[ \t]*+){200,}")
"""a dotted key so long that parsing it takes a time that grows with its square"""
WHOLE = 1 << 63  # whole numbers are below, as those of arrays and tables are

UNREADABLE = (
    ArithmeticError,
    AssertionError,
    AttributeError,
    EOFError,
    LookupError,
    MemoryError,
    OSError,
    RuntimeError,  # RecursionError and NotImplementedError are
    SyntaxError,
    TypeError,
    ValueError,
)
"""what parsers, ours and those of other projects, raise at a damaged file"""

Kind = TypeVar("Kind")


def size(count: float) -> str:
    """A number of bytes in words."""
    for unit in ("bytes", "KiB", "MiB"):
        if count < 1024:
            return f"{count:.4g} {unit}"
        count /= 1024
    return f"{count:.4g} GiB"


@contextmanager
def regular(path: Path | str, *, most: int = DATA) -> Iterator[BinaryIO]:
    """Open a regular file that is not too large.

    Args:
        path: of the file.
        most: bytes that it may have.

    Raises:
        FormatError: not there, no regular file (a directory, a pipe, a device), not to
            be read, or too large.
    """
    try:
        descriptor = _opened(path)
    except (OSError, ValueError) as error:  # ValueError: a NUL in the name
        reason = getattr(error, "strerror", None) or error
        raise FormatError(f"{path} cannot be read: {reason}.") from error
    with os.fdopen(descriptor, "rb") as file:
        found = os.fstat(descriptor).st_size
        if found > most:
            raise FormatError(
                f"{path} has {size(found)}, {size(most)} is the most that is read: "
                "give a smaller one."
            )
        try:
            yield file
        except OSError as error:
            raise FormatError(f"{path} cannot be read: {error.strerror}.") from error


def _opened(path: Path | str) -> int:
    """A descriptor of a regular file; what else is there is not even opened."""
    for look in (os.stat, os.open):
        if look is os.stat:
            mode = os.stat(path).st_mode
        else:
            descriptor = os.open(path, os.O_RDONLY | getattr(os, "O_NONBLOCK", 0))
            mode = os.fstat(descriptor).st_mode
        if not stat.S_ISREG(mode):
            if look is os.open:
                os.close(descriptor)
            raise FormatError(f"{path} is no regular file: give the file itself.")
    return descriptor


def read_bytes(path: Path | str, *, most: int = TEXT) -> bytes:
    """The content of a file.

    Raises:
        FormatError: as `regular`.
    """
    with regular(path, most=most) as file:
        return file.read(most + 1)


def read_packed(path: Path | str, *, most: int = DATA) -> bytes:
    """The content of a gzipped file; `most` bounds it packed and unpacked.

    Raises:
        FormatError: as `regular`; damaged.
    """
    with regular(path, most=most) as packed:
        try:
            data = gzip.GzipFile(fileobj=packed).read(most + 1)
        except (*UNREADABLE, zlib.error) as error:
            raise FormatError(f"{path} cannot be unpacked: {error}.") from error
    if len(data) > most:
        raise FormatError(f"{path} unpacks to more than {size(most)}.")
    return data


def read_text(path: Path | str, *, most: int = TEXT) -> str:
    """The content of a text file in UTF-8, with or without a byte order mark.

    Raises:
        FormatError: as `regular`; not UTF-8.
    """
    return decoded(read_bytes(path, most=most), path)


def decoded(data: bytes, name: object) -> str:
    """Bytes in UTF-8 as text.

    Raises:
        FormatError: they are not UTF-8.
    """
    try:
        return data.decode("utf-8-sig")
    except UnicodeDecodeError as error:
        raise FormatError(
            f"{name} is no text in UTF-8 (byte {error.start}): save it as UTF-8."
        ) from error


def read_toml(path: Path | str) -> dict[str, Any]:
    """The content of a TOML file.

    Raises:
        FormatError: as `regular`; not TOML, nested too deep, a number too large.
    """
    return toml(read_text(path), path)


def toml(text: str, name: object) -> dict[str, Any]:
    """The content of TOML text; `name` is the file's, for messages.

    Raises:
        FormatError: not TOML, nested too deep, a number too large.
    """
    if _CHAIN.search(text):
        raise FormatError(f"{name} cannot be read as TOML: it is nested too deep.")
    try:
        content = tomllib.loads(text)
    except (ValueError, RecursionError) as error:
        raise FormatError(f"{name} cannot be read as TOML: {_why(error)}.") from error
    return plain(content, name)


def read_json(path: Path | str, *, most: int = TEXT) -> dict[str, Any]:
    """The JSON object in a file.

    Raises:
        FormatError: as `regular`; not JSON, no object, nested too deep, a number too
            large.
    """
    content = json(read_bytes(path, most=most), path)
    if not isinstance(content, dict):
        raise FormatError(f"{path} holds no JSON object.")
    return content


def json(data: bytes | str, name: object) -> Any:
    """The content of JSON text; `name` is the file's, for messages.

    Raises:
        FormatError: not JSON, nested too deep, a number too large.
    """
    try:
        content = msgspec.json.decode(data)
    except (msgspec.MsgspecError, UnicodeError, RecursionError) as error:
        raise FormatError(f"{name} cannot be read as JSON: {_why(error)}.") from error
    return plain(content, name)


def plain(content: Any, name: object) -> Any:
    """Parsed content, if it is flat enough and its whole numbers fit 64 bits.

    Raises:
        FormatError: they do not.
    """
    level = [content]
    for _ in range(DEEPEST):
        deeper: list[Any] = []
        for value in level:
            if isinstance(value, dict):
                deeper += value.values()
            elif isinstance(value, list):
                deeper += value
            elif isinstance(value, int) and not -WHOLE <= value < WHOLE:
                raise FormatError(
                    f"{name} holds a whole number of {value.bit_length()} bits: 64 "
                    "are the most."
                )
        if not deeper:
            return content
        level = deeper
    raise FormatError(f"{name} is nested deeper than {DEEPEST} levels: flatten it.")


def typed(content: Any, kind: type[Kind], name: object, *, todo: str = "") -> Kind:
    """Content as what it has to be, numbers within their bounds.

    Args:
        content: as parsed.
        kind: a `msgspec.Struct`, or what else msgspec converts to; bounds are
            `msgspec.Meta`. NaN and infinity are within no bounds.
        name: of the file, for messages.
        todo: what to do if it is not, a sentence.

    Raises:
        FormatError: where it is not so, and what is allowed there.
    """
    try:
        return msgspec.convert(content, kind)
    except (msgspec.ValidationError, ValueError, RecursionError) as error:
        why, _, place = str(error).partition(" - at ")
        where = f", at {place.strip('`').removeprefix('$.')}" if place else ""
        more = f" {todo}" if todo else ""
        raise FormatError(f"{name} is not as it should be{where}: {why}.{more}") from (
            error
        )


def tables(
    content: Mapping[str, Any], kind: type[Kind], name: object, *, todo: str = ""
) -> dict[str, Kind]:
    """Each table of some content as `typed` makes it; errors say which it is.

    Args:
        content: name -> table, as parsed.
        kind: what each has to be, see `typed`.
        name: of the file, for messages.
        todo: what to do if one is not, a sentence.

    Raises:
        FormatError: as `typed`.
    """
    return {
        key: typed(table, kind, f"[{key}] in {name}", todo=todo)
        for key, table in content.items()
    }


def _why(error: Exception) -> str:
    if isinstance(error, RecursionError):
        return "it is nested too deep"
    return str(error).rstrip(".")
