"""What is known of a recording whose diagnosis could not be finished."""

import json
from collections.abc import Sequence
from pathlib import Path

from bns.errors import BnsError
from bns.gap.models.base import GapModel
from bns.gap.recordings import check
from bns.worlds.trial import Trial

FILE = "partial.json"
SCHEMA, VERSION = "bns-diagnosis-partial", 1


def write(trials: Sequence[Trial], model: GapModel, error: BnsError, out: Path) -> Path:
    """Keep what the check found, and why the rest is missing; gives the file."""
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
    Path(out).mkdir(parents=True, exist_ok=True)
    path = Path(out) / FILE
    path.write_text(json.dumps(content, indent=1) + "\n", encoding="utf-8")
    return path
