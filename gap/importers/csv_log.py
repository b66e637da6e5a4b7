"""CSV tables: a line of names, and columns of numbers.

Moments in ISO 8601 become seconds; other columns of text are left out. A last line
that was cut off is dropped, and so are rows that are there again.
"""

import codecs
import re
from collections.abc import Mapping, Sequence
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.importers.tables import Column, Table, moments
from bns.storage import reading, tables

PACKED = ".gz"
WIDE = (codecs.BOM_UTF16_LE, codecs.BOM_UTF16_BE)


def read(path: Path) -> Table:
    """The numbers in a table.

    A column of which most cells that are filled are numbers is one, and no cell of it
    may be text. What parts the names parts the columns: a comma, a semicolon or a tab;
    beside the latter two numbers may have a decimal comma.

    Args:
        path: of the file; one that ends with `.gz` is unpacked.

    Raises:
        FormatError: not there, no table, a column twice, or text among numbers.
    """
    packed = str(path).lower().endswith(PACKED)
    load = reading.read_packed if packed else reading.read_bytes
    data = load(path, most=reading.DATA)
    _text(data, path)
    found, notes = _numbers(data, path)
    if not found or not len(next(iter(found.values()))):
        raise FormatError(f"{path} is no CSV table of numbers with a line of names.")
    kept = _once(found)
    if kept is not None:
        count = len(next(iter(found.values()))) - len(kept)
        notes.append(f"{count} rows are there again as they were, left out")
        found = {name: values[kept] for name, values in found.items()}
    columns = tuple(Column(name, values) for name, values in found.items())
    return Table(columns, "CSV table", tuple(notes))


def _text(data: bytes, path: Path) -> None:
    """Stop at what is no text in UTF-8 at the first look.

    Raises:
        FormatError: empty, or in UTF-16.
    """
    if not data.strip():
        raise FormatError(
            f"{path} is empty, so that it cannot be read as CSV: give a table with a "
            "line of names."
        )
    if data.startswith(WIDE):
        raise FormatError(f"{path} is text in UTF-16: save it as UTF-8.")


def _numbers(data: bytes, path: Path) -> tuple[dict[str, np.ndarray], list[str]]:
    """Columns of numbers, and what was left out; without the last line, if that helps.

    Raises:
        FormatError: not there, no table, a column twice, or text among numbers.
    """
    try:
        return _columns(data, path), []
    except FormatError as error:
        whole, _, last = data.rstrip(b"\r\n\0").rpartition(b"\n")
        try:
            found = _columns(whole, path)
        except FormatError:
            raise error from None
        if not len(next(iter(found.values()), ())):
            raise
        shown = last[-40:].decode(errors="replace").strip()
        return found, [f"the last line is cut off or no row, left out: ...{shown}"]


def _columns(data: bytes, path: Path) -> dict[str, np.ndarray]:
    """Columns of numbers, truth values and moments as doubles; empty cells are NaN."""
    from pyarrow import types

    table, names = tables.parsed(data, path, *_separators(data))
    tables.once(names, names, path)
    columns = dict(zip(names, table.columns, strict=True))
    seconds = moments(columns)
    found = {}
    for name, column in columns.items():
        column = column.cast("int8") if types.is_boolean(column.type) else column
        if types.is_string(column.type):
            _check_text(column.to_pylist(), name, path)
        elif name in seconds:
            found[name] = seconds[name]
        elif tables.is_number(column.type):
            found[name] = tables.doubles(column, name, path)
    return found


def _check_text(cells: Sequence[str | None], name: str, path: Path) -> None:
    """Stop at a cell of text in a column of numbers.

    Raises:
        FormatError: there is one.
    """
    filled = [(row, cell) for row, cell in enumerate(cells) if cell]
    texts = [(row, cell) for row, cell in filled if not _reads(cell)]
    if texts and len(texts) < len(filled) / 2:
        row, cell = texts[0]
        raise FormatError(
            f"{path}: the column {name!r} holds {cell!r} in line {row + 2}, "
            "which is no number; leave a cell empty where nothing was measured."
        )


def _reads(cell: str) -> bool:
    """Whether a cell is a number."""
    try:
        float(cell)
    except ValueError:
        return False
    return True


def _separators(data: bytes) -> tuple[str, str]:
    """What parts the columns of the bytes of a file, and its decimal point."""
    head, _, rows = data.partition(b"\n")
    delimiter = max(",;\t", key=lambda sign: head.count(sign.encode()))
    if delimiter == "," or re.search(rb"\d\.\d", rows):
        return delimiter, "."
    return delimiter, "," if re.search(rb"\d,\d", rows) else "."


def _once(found: Mapping[str, np.ndarray]) -> np.ndarray | None:
    """Rows without those that are there again; None = all.

    Where no column grows all the way there are no stamps that tell one row from the
    next, and equal rows are a robot that stands.
    """
    if any((np.diff(values) > 0).all() for values in found.values()):
        return None
    table = np.ascontiguousarray(np.stack(list(found.values()), axis=1))
    rows = table.view(np.dtype((np.void, table.dtype.itemsize * table.shape[1])))
    kept = np.sort(np.unique(rows.ravel(), return_index=True)[1])
    if len(kept) == len(table) or len(kept) < len(table) / 2:
        return None
    grows = (np.diff(table[kept], axis=0) > 0).all(axis=0)
    return kept if grows.any() else None
