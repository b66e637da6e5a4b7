"""What is known of a recording whose diagnosis could not be finished."""

from collections.abc import Sequence
from pathlib import Path

from bns.errors import BnsError
from bns.gap.models.base import GapModel
from bns.gap.recordings import check
from bns.storage import files
from bns.worlds.trial import Trial

FILE = "partial.json"
SCHEMA, VERSION = "bns-diagnosis-partial", 1


def write(trials: Sequence[Trial], model: GapModel, error: BnsError, out: Path) -> Path:
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
    path = Path(out) / FILE
    files.write_json(path, content)
    return path
