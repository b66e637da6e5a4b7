"""Tables on the standard output: for a reader, or as JSON."""

import json as jsonlib
import os
import sys
from collections.abc import Sequence

PIPED = 160
"""width where there is neither a terminal nor `COLUMNS`"""


def show(head: Sequence[str], rows: Sequence[Sequence[str]], *, json: bool) -> None:
    """Print rows under their heads, as wide as the terminal or as `COLUMNS` says; as
    JSON one object per row.

    Args:
        head: names of the columns.
        rows: cells as text, as many in each row as in `head`.
        json: print JSON, not a table.
    """
    if json:
        found = [dict(zip(head, row, strict=True)) for row in rows]
        print(jsonlib.dumps(found, indent=2, ensure_ascii=False))
        return
    from rich import box
    from rich.console import Console
    from rich.table import Table

    table = Table(*head, box=box.SIMPLE, pad_edge=False, header_style="bold")
    for row in rows:
        table.add_row(*row)
    known = sys.stdout.isatty() or "COLUMNS" in os.environ
    width = None if known else PIPED
    Console(width=width, markup=False, highlight=False).print(table)
