"""A diagnosis that is not finished: what was asked for, and what is known until then.

The request is kept in the diagnosis's directory until it is done. A process that is
killed leaves it there: the same command then goes on, or starts over. Where a diagnosis
has to stop, what its check found is kept instead.
"""

import itertools
from collections.abc import Mapping, Sequence
from pathlib import Path
from typing import Any

import msgspec

from bns.errors import BnsError
from bns.gap.models.base import GapModel
from bns.gap.recordings import check
from bns.gap.store import FILE as DIAGNOSIS
from bns.storage import files, reading, seal
from bns.worlds.trial import Trial

FILE = "request.json"
FORMAT = "bns-diagnosis-request"


class Request(msgspec.Struct):
    """The file."""

    format: str
    asked: dict[str, Any]


def place(named: Path, asked: Mapping[str, Any]) -> Path:
    """A directory for a diagnosis to which none was given.

    Args:
        named: the first to be tried; further ones end in -2, -3 and so on.
        asked: what is diagnosed.

    Returns:
        the first that is free, or holds the same diagnosis unfinished.
    """
    numbered = (named.with_name(f"{named.name}-{n}") for n in itertools.count(2))
    every = itertools.chain([named], numbered)
    return next(out for out in every if _free(out, asked))


def _free(out: Path, asked: Mapping[str, Any]) -> bool:
    """Whether a diagnosis can begin in a directory, or go on there."""
    if not out.exists():
        return True
    try:
        _check(out, asked)
    except (BnsError, NotADirectoryError):
        return False
    return True


def begin(out: Path, asked: Mapping[str, Any]) -> None:
    """Note in a directory, locked by who calls, what is diagnosed there.

    What a killed process left half-written is removed; of another request nothing is.

    Raises:
        BnsError: it holds a finished diagnosis, one of another request, or something
            else.
    """
    _check(out, asked)
    files.remove_temporary(out)
    files.write_json(out / FILE, {"format": FORMAT, "asked": dict(asked)})


def _check(out: Path, asked: Mapping[str, Any]) -> None:
    path = out / FILE
    if not path.exists():
        _check_free(out)
        return
    content = seal.opened(reading.read_json(path), path)
    if reading.typed(content, Request, path).asked != dict(asked):
        raise BnsError(
            f"{out} holds an unfinished diagnosis of something else: repeat its "
            "command, give another --out, or remove it."
        )


def _check_free(out: Path) -> None:
    held = sorted(path.name for path in out.iterdir())
    held = [name for name in held if not name.startswith(files.TEMPORARY)]
    if DIAGNOSIS in held:
        raise BnsError(
            f"{out} holds a finished diagnosis, which is not overwritten: give another "
            "--out, or remove it."
        )
    if [name for name in held if name != PARTIAL]:
        raise BnsError(
            f"{out} holds {held[0]} and is not overwritten; give another --out."
        )


def end(out: Path) -> None:
    """The diagnosis is whole: nothing is left to do in the directory."""
    (out / PARTIAL).unlink(missing_ok=True)
    drop(out)


def drop(out: Path) -> None:
    """Forget the request: what was asked for cannot be had."""
    (out / FILE).unlink(missing_ok=True)


PARTIAL = "partial.json"
SCHEMA, VERSION = "bns-diagnosis-partial", 1


def write_partial(
    trials: Sequence[Trial], model: GapModel, error: BnsError, out: Path
) -> Path:
    """Keep what the check found, and why the rest is missing; gives the file.

    Args:
        trials: the recording.
        model: nominal model.
        error: what stopped the diagnosis.
        out: directory for the file, made if missing.
    """
    try:
        usable, faults = check.check(trials, model)
    except BnsError:
        usable, faults = (), ()
    content = {
        "schema": SCHEMA,
        "version": VERSION,
        "model": model.name,
        "trials": len(trials),
        "usable": len(usable),
        "faults": list(faults),
        "stopped by": str(error),
    }
    files.make_directory(Path(out))
    path = Path(out) / PARTIAL
    files.write_json(path, content)
    return path
