"""Parsing with tyro, its errors brought to one line."""

import contextlib
import io
import re
from collections.abc import Callable, Mapping, Sequence
from typing import Any, TypeVar

import tyro

from bns.errors import BnsError, UnknownNameError

T = TypeVar("T")
_FRAME = " │╭╮╰╯"
_RULE = re.compile(r"[─-]{8,}")


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


def dispatch(
    verb: str,
    argv: Sequence[str],
    does: Mapping[str, tuple[type, Callable[[Any], int]]],
    manual: str,
) -> int:
    """Do one of a verb's own verbs; gives the exit code.

    Args:
        verb: as in "campaign".
        argv: what follows it; nothing, or a call for help, prints the manual and exits.
        does: its verbs: what their arguments are, and what they do with them.
        manual: of the verb.

    Raises:
        UnknownNameError: no such verb.
    """
    if not argv or argv[0] in ("-h", "--help"):
        print(manual)
        raise SystemExit(0)
    if argv[0] not in does:
        raise UnknownNameError(f"verb of `bns {verb}`", argv[0], does)
    kind, do = does[argv[0]]
    return do(parse(kind, argv[1:], prog=f"bns {verb} {argv[0]}"))


def _one_line(box: str) -> str:
    """What tyro's box says, without the box, its title and pointers to more help.

    The box is a title and parts with rules between them; on a terminal that knows
    UTF-8 the title is part of the frame, elsewhere a line above the first rule.
    """
    lines = [line.strip(_FRAME) for line in box.splitlines()]
    lines = [line for line in lines if line][1:]  # without the title
    if lines and _RULE.fullmatch(lines[0]):
        lines = lines[1:]
    parts: list[list[str]] = [[]]
    for line in lines:
        if _RULE.fullmatch(line):
            parts.append([])
        else:
            parts[-1].append(line)
    said = " ".join(parts[0]).rstrip(".") + "."
    for part in parts[1:]:
        if len(part) > 1 and part[0].startswith("Perhaps you meant"):
            option = part[1].split()[0].rstrip(",")  # of a flag and its opposite
            said += f" Did you mean {option}?"
    return said
