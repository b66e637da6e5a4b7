"""A diagnosis in a directory, and what of it can be simulated again."""

import json
from pathlib import Path

from bns.errors import BnsError, FormatError, UnknownNameError
from bns.gap.models.base import GapModel
from bns.gap.records import Diagnosis, Fit
from bns.storage import files, reading, seal
from bns.worlds.effects.base import Effect

FILE = "diagnosis.json"
HEAD = 256 << 20  # [bytes] of it


def save(found: Diagnosis, directory: str | Path) -> Path:
    """Write a diagnosis into a directory, which is created; gives the file."""
    directory = Path(directory)
    files.make_directory(directory)
    content = seal.sealed(json.loads(found.to_json()))
    text = json.dumps(content, indent=1, sort_keys=True) + "\n"
    files.write_text(directory / FILE, text)
    return directory / FILE


def load(directory: str | Path) -> Diagnosis:
    """The diagnosis of a directory.

    Raises:
        FormatError: there is none, or it is not to be read.
    """
    path = Path(directory) / FILE
    if not path.exists():
        raise FormatError(
            f"{directory} holds no {FILE}: make one with bns gap diagnose DATA --out "
            f"{directory}."
        )
    content = seal.opened(reading.read_json(path, most=HEAD), path)
    try:
        return Diagnosis.of(content)
    except FormatError as error:
        raise FormatError(f"{path}: {error}") from error


def parse(text: str, model: GapModel) -> Effect:
    """An effect as a diagnosis with this model writes it."""
    return model.parse(text)


def chosen(found: Diagnosis, names: str = "") -> Fit:
    """The fit that stands for the gap.

    Args:
        found: a diagnosis.
        names: of the effects, joined by "+"; "" = those that the verdict names first.

    Raises:
        BnsError: the verdict names nothing.
        UnknownNameError: no such support was fitted.
    """
    if names:
        wanted = {name.strip() for name in names.split("+")}
        for fit in found.fits:
            if set(fit.names) == wanted:
                return fit
        known = [" + ".join(fit.names) for fit in found.fits if fit.names]
        raise UnknownNameError("fitted effect", names, known)
    if not found.verdict.named:
        raise BnsError(
            f"The verdict is {found.verdict.kind!r}: there is nothing to correct or "
            "take away. Give --effect NAME to take a fit all the same."
        )
    return found.best
