"""What a walking robot has probably lost, so that its scatter is found without it.

Robots that lack a leg stumble where whole ones walk: what such a recording may depart
by is found by the walks of robots that lack it as well, see `scatter`.
"""

from collections.abc import Callable, Sequence

import numpy as np

from bns.gap.decomposition.row import Row
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

BETTER = 0.7  # of the servos' squared departure, which a loss has to leave at most

Simulate = Callable[[Sequence[Trial], Sequence[Sequence[Effect]]], list]


def likely(
    trials: Sequence[Trial], candidates: Sequence[Row], simulate: Simulate
) -> tuple[Effect, ...]:
    """Losses that explain the servos' positions best, one after the other.

    Args:
        trials: recordings, the joints' positions after the pose.
        candidates: what may be lost, each as a whole.
        simulate: see `GapModel.simulate`.

    Returns:
        none, where none explains much.
    """
    found: tuple[Effect, ...] = ()
    left = [item.make(item.high) for item in candidates]
    if not left:
        return found
    (before,) = _departures(trials, simulate(trials, [found]))
    while left:
        off = _departures(trials, simulate(trials, [(*found, item) for item in left]))
        best = int(np.argmin(off))
        if not off[best] < BETTER * before:
            break
        found, before = (*found, left.pop(best)), off[best]
    return found


def _departures(trials: Sequence[Trial], walks: Sequence) -> list[float]:
    """Mean squared departure of the servos in each set of walks; infinite: diverged."""
    made = []
    for paths in walks:
        rests = [
            t.observed[:, 3:] - p[:, 3:] for t, p in zip(trials, paths, strict=True)
        ]
        square = np.vstack(rests) ** 2
        lost = not all(np.isfinite(path).all() for path in paths)
        made.append(np.inf if lost else float(np.nanmean(square)))
    return made
