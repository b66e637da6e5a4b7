"""Key figures of a run, in numbers and in words."""

import numpy as np

from bns.record import RunRecord


def to_solve(record: RunRecord) -> np.ndarray:
    """Trials until the first solved one, that one included, ``(R,)``; inf = never."""
    return _first(record["solved"] > 0)


def to_recover(record: RunRecord) -> np.ndarray:
    """Trials from the onset until the first solved one, ``(R,)``; inf = never."""
    counts = np.full(record.replicates, np.inf)
    for at, onset in enumerate(record.damage_onset):
        if 0 <= onset < record.trials:
            counts[at] = _first(record["solved"][at : at + 1, onset:] > 0)[0]
    return counts


def _first(done: np.ndarray) -> np.ndarray:
    return np.where(done.any(axis=1), done.argmax(axis=1) + 1.0, np.inf)
