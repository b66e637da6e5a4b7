"""Simulated features of servo runs under each candidate, over its magnitudes."""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.servo.candidates import columns
from bns.gap.models.servo.nominal import Nominal
from bns.gap.models.servo.runs import SAMPLE, Runs
from bns.worlds.physics.servo_rollout import simulate

STEP = 0.1  # [s] between two features of a run
SLOW = ("servo_backlash",)
_EVERY = round(STEP / SAMPLE)


def features(angles: np.ndarray) -> np.ndarray:
    """Angles every 0.1 s, the start left out, shape ``(..., F)`` [rad]."""
    return angles[..., _EVERY::_EVERY]


@dataclass(frozen=True, eq=False)
class Curve:
    """One candidate's features along its magnitudes, as departures from nominal.

    Attributes:
        candidate: whose.
        magnitudes: increasing, the nominal among them, shape ``(G,)``.
        departures: shape ``(R, G, F)`` [rad]; 0 at the nominal.
    """

    candidate: Row
    magnitudes: np.ndarray
    departures: np.ndarray


def residuals(runs: Runs, nominal: Nominal) -> np.ndarray:
    """Recorded minus nominal features, shape ``(R, F)`` [rad]."""
    return features(runs.angles) - features(nominal.predict(runs))


def curves(
    runs: Runs,
    nominal: Nominal,
    candidates: Sequence[Row],
    magnitudes: Mapping[str, Sequence[float] | np.ndarray] | None = None,
) -> list[Curve]:
    """Simulate candidates at their magnitudes, all runs in one batch.

    Args:
        runs: R runs.
        nominal: the law without an effect.
        candidates: the effects.
        magnitudes: by name; None = each candidate's grid and its nominal.
    """
    grids = [
        np.unique(magnitudes[c.name] if magnitudes else (*c.levels, c.nominal))
        for c in candidates
    ]
    law = nominal.told(runs)
    made: dict[int, Curve] = {}
    for slow in (False, True):  # play costs more a step: in a batch of its own
        mine = [i for i, c in enumerate(candidates) if (c.name in SLOW) == slow]
        sets = [(), *([candidates[i].make(v)] for i in mine for v in grids[i])]
        if not mine:
            continue
        batch = features(simulate(columns(law, sets), runs.drive))
        ends = np.cumsum([1, *(len(grids[i]) for i in mine)])
        for i, low, high in zip(mine, ends[:-1], ends[1:], strict=True):
            departures = batch[:, low:high] - batch[:, :1]
            made[i] = Curve(candidates[i], grids[i], departures)
    return [made[i] for i in range(len(candidates))]


def nearest(
    whitened: np.ndarray, target: np.ndarray, magnitudes: np.ndarray, log: bool
) -> tuple[float, float]:
    """The point of a piecewise linear curve that is nearest to a target.

    Args:
        whitened: points of the curve, shape ``(G, D)``.
        target: shape ``(D,)``.
        magnitudes: of the points, shape ``(G,)``.
        log: whether magnitudes are interpolated by ratio.

    Returns:
        Squared distance and magnitude.
    """
    scale = np.log(magnitudes) if log else magnitudes
    piece = np.diff(whitened, axis=0)
    rest = target - whitened[:-1]
    length = np.maximum((piece**2).sum(axis=1), 1e-12)
    share = np.clip((piece * rest).sum(axis=1) / length, 0.0, 1.0)
    distance = ((rest - share[:, None] * piece) ** 2).sum(axis=1)
    best = int(np.argmin(distance))
    found = scale[best] + share[best] * (scale[best + 1] - scale[best])
    return float(distance[best]), float(np.exp(found) if log else found)
