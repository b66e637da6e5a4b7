"""A directory of tables, one trial a file, in the order of their names.

Numbers in names count as such: `run_10` is after `run_9`. A file whose columns are not
those of most is left out.
"""

import re
from collections import Counter
from collections.abc import Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np

from bns.gap.importers import other_files, tables
from bns.gap.importers.tables import TRIAL, Column, Table


def read(path: Path) -> Table:
    """The tables of a directory as one, with a column `trial` that numbers them; where
    they have such a column, each of its numbers in each file is a trial.

    Raises:
        FormatError: a file that is no table.
    """
    files = sorted(other_files.tables_in(path), key=_order)
    found = [tables.read(file) for file in files]
    usual, _ = Counter(frozenset(table.names) for table in found).most_common(1)[0]
    kept = [table for table in found if set(table.names) == usual]
    notes = [
        f"{file.name}: left out, its columns are not those of the others"
        for file, table in zip(files, found, strict=True)
        if set(table.names) != usual
    ]
    notes += dict.fromkeys(note for table in kept for note in table.notes)
    first = kept[0]
    trial = Column(TRIAL, _numbered(kept))
    columns = [
        replace(column, values=np.concatenate([table[column.name] for table in kept]))
        for column in first.columns
        if column.name != TRIAL
    ]
    kind = f"directory of {len(kept)} files ({first.kind})"
    return Table((trial, *columns), kind, tuple(notes))


def _numbered(kept: Sequence[Table]) -> np.ndarray:
    """The number of the trial of each row of all tables."""
    made, first = [], 0
    for table in kept:
        marks = np.zeros(len(table.columns[0].values), int)
        if TRIAL in table:
            marks = np.cumsum(np.diff(table[TRIAL], prepend=table[TRIAL][:1]) != 0)
        made.append(first + marks)
        first += int(marks[-1]) + 1
    return np.concatenate(made).astype(float)


def _order(file: Path) -> list[tuple[int, str]]:
    """Names by which files are sorted, the numbers in them as such."""
    return [
        (int(piece), "") if piece.isdigit() else (-1, piece)
        for piece in re.split(r"(\d+)", file.name.lower())
        if piece
    ]
