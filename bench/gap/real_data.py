"""Where recordings of real robots lie, if they are there; none is in the repository."""

import os
from pathlib import Path

from bench.versions import ROOT
from bns.errors import BnsError

VARIABLE = "BNS_REAL_DATA"
_DEFAULT = ROOT.parent / "shared" / "data"


def directory(name: str) -> Path | None:
    """The directory of one set of real recordings, or None where it is absent.

    Args:
        name: of the set, as its reader in `bns.gap.importers` is called.
    """
    found = Path(os.environ.get(VARIABLE, _DEFAULT)) / name
    return found if found.is_dir() else None


def reason(name: str) -> str:
    """Why something that needs a set is skipped."""
    return f"needs the recordings {name!r}: set {VARIABLE} to a directory that has them"


def needed(name: str) -> Path:
    """The directory of a set.

    Raises:
        BnsError: it is absent.
    """
    found = directory(name)
    if found is None:
        raise BnsError(f"Skipped: {reason(name)}.")
    return found
