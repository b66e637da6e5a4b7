"""Tables on the standard output: for a reader, or as JSON."""

import json as jsonlib
import sys
from collections.abc import Sequence


def show(head: Sequence[str], rows: Sequence[Sequence[str]], *, json: bool) -> None:
    """Print rows under their heads; as JSON one object per row."""
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
    width = None if sys.stdout.isatty() else 160
    Console(width=width, markup=False, highlight=False).print(table)
