"""Rows of what ends a joint's motion sooner than its model does: a stop, or a spring
that begins somewhere on its way."""

from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace

import numpy as np

from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf.described import Seen
from bns.worlds.effects.base import Effect
from bns.worlds.trial import Trial

BUMPER = "joint_bumper"
SHORT, SHARE = 5.0, 0.01  # of the noise, of a joint's travel: sooner by more is stopped
STOPPED = 0.995  # quantile of a joint's positions at which a stop may be
BESIDE = (0.0, 0.02, -0.02)  # of its travel, beside which one is tried
SOONER = 0.2  # of its travel, by which a stop may be sooner; later by a quarter of it
STIFF = (0.005, 0.05, 0.4)  # of the stiffest spring, which is tried
BEGINS = 0.1  # of its travel, before the end of which a spring is taken to begin,
EARLIEST, FURTHER = 0.6, 0.15  # and by which it may begin earlier, or plausibly
UPWARD = {"high": True, "low": False, "above": True, "below": False}
"""whether a number is of what is met on the way up"""
FROM = {"above": "high", "below": "low"}
"""the number that says where a spring begins"""


def sooner(
    seen: Sequence[Seen], trials: Sequence[Trial], travel: Mapping[str, np.ndarray]
) -> dict[str, np.ndarray]:
    """Joints that went less far than the nominal motion, by name: lowest and highest
    position recorded, and in that, ``(2, 2)``.

    Args:
        seen: what each observed column is.
        trials: a recording.
        travel: of the nominal motion of some trials, see `Loads`.
    """
    found = {}
    for column, item in enumerate(seen):
        if item.quantity == "joint":
            went = np.concatenate([trial.observed[:, column] for trial in trials])
            ends = np.nanquantile(went, (1.0 - STOPPED, STOPPED))
            free = travel.get(item.part, ends)
            out = np.array([ends[0] - free[0], free[1] - ends[1]])
            least = max(SHORT * item.noise, SHARE * float(np.ptp(free)))
            free = np.where(out > least, free, ends)
            if (free != ends).any():
                found[item.part] = np.stack([ends, free])
    return found


def rows(item: Row, ends: np.ndarray | None) -> Iterable[Row]:
    """Numbers of what may be where the recorded motion ends before the nominal does.

    Args:
        item: the candidate, a stop's end or a spring's stiffness.
        ends: of its joint: lowest and highest position recorded, and in the nominal
            motion, ``(2, 2)``; None = it ends nowhere sooner.
    """
    up = UPWARD[item.parameter]
    way, place = (1.0, 1) if up else (-1.0, 0)
    if ends is None or way * (ends[1, place] - ends[0, place]) <= 0:
        return
    travel, at = float(np.ptp(ends[1])), float(ends[0, place])
    if item.effect == BUMPER:
        yield from _bumper(item, at, way * travel)
        return
    free = float(ends[1, place]) + way * SOONER * travel / 4
    sooner = at - way * SOONER * travel
    yield replace(
        item,
        nominal=free,
        sd=travel / 3,
        low=min(free, sooner),
        high=max(free, sooner),
        smooth=False,
        levels=tuple(at + share * travel for share in BESIDE),
    )


def _bumper(item: Row, at: float, travel: float) -> Iterable[Row]:
    """The stiffness of a spring, and where it begins: one explanation.

    Args:
        item: the candidate.
        at: where the recorded motion ends.
        travel: of the nominal motion, negative on the way down.
    """
    begins = at - BEGINS * travel
    low, high = sorted((at - EARLIEST * travel, at + BEGINS * travel))
    parameter = FROM[item.parameter]
    yield replace(
        item,
        levels=tuple(share * item.high for share in STIFF),
        group=item.name,
        fixed={**item.fixed, parameter: begins},
    )
    yield Row(
        f"{item.name}.{parameter}",
        begins,
        FURTHER * abs(travel),
        low,
        high,
        unit="m" if item.unit == "N/m" else "rad",
        group=item.name,
        excite=item.excite,
    )


def spring(item: Row, values: Mapping[str, float]) -> Effect:
    """A spring that begins where its second number says.

    Args:
        item: its first row, as of `rows`.
        values: of its rows that are not nominal.
    """
    parameter = FROM[item.parameter]
    begins = values.get(f"{item.name}.{parameter}", item.fixed[parameter])
    at = replace(item, fixed={**item.fixed, parameter: begins})
    return at.make(values.get(item.name, item.nominal))
