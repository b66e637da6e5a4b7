"""Parsing with tyro, its errors brought to one line."""

import contextlib
import io
import re
from collections.abc import Sequence
from typing import Any, TypeVar

import tyro

from bns.errors import BnsError

T = TypeVar("T")
_BOX = re.compile(r"^[\s╭╮╰╯│─]+|[\s╭╮╰╯│─]+$")


def parse(
    kind: type[T], argv: Sequence[str], *, prog: str, default: Any = tyro.MISSING
) -> T:
    """An instance of the dataclass `kind` from command-line arguments.

    `--help` prints the manual and exits, as usual.

    Raises:
        BnsError: the arguments are not understood.
    """
    given = {} if default is tyro.MISSING else {"default": default}
    heard = io.StringIO()
    try:
        with contextlib.redirect_stderr(heard):
            return tyro.cli(kind, args=list(argv), prog=prog, **given)
    except SystemExit as end:
        if not end.code:
            raise
        raise BnsError(f"{_one_line(heard.getvalue())} See {prog} --help.") from end


def _one_line(box: str) -> str:
    """What tyro's box says, without the box and its pointers to more help."""
    parts: list[list[str]] = [[]]
    for line in box.splitlines()[1:]:
        if re.fullmatch(r"│ ─+ │", line.strip()):
            parts.append([])
        elif text := _BOX.sub("", line):
            parts[-1].append(text)
    said = " ".join(parts[0]).rstrip(".") + "."
    for part in parts[1:]:
        if len(part) > 1 and part[0].startswith("Perhaps you meant"):
            said += f" Did you mean {part[1].split()[0]}?"
    return said
