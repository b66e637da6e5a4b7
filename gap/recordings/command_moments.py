"""When commands began, as far as a recording tells."""

from collections.abc import Sequence

import numpy as np

from bns.worlds.data.importing import MOMENTS
from bns.worlds.trial import Trial


def sampled(trials: Sequence[Trial]) -> list[Trial]:
    """Trials of which it is known to a sample only when commands began."""
    return [trial for trial in trials if trial.conditions.get(MOMENTS) == "sampled"]


def unknown(trials: Sequence[Trial]) -> float:
    """Seconds within which it is not known when commands began; 0 = it is known."""
    found = sampled(trials)
    if not found:
        return 0.0
    return float(np.median(np.concatenate([np.diff(trial.times) for trial in found])))
