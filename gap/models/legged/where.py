"""Which joints and legs of a walking robot depart, before anything is fitted."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from bns.models.legs import names as legs_of

MOST, LEAST = 0.6, 0.3  # share of the worst leg: beyond it alone, below it all alike
NEARLY = 0.6  # of the worst leg's share: the second is suspected as well


@dataclass(frozen=True)
class Suspects:
    """Where the servos' positions depart most.

    Attributes:
        joints: names, the worst first.
        legs: names of legs, the worst first.
        all: whether effects on the servos of all legs are suspected as well.
    """

    joints: tuple[str, ...]
    legs: tuple[str, ...]
    all: bool


def shares(
    rests: Sequence[np.ndarray], names: Sequence[str], sigma: float
) -> dict[str, float]:
    """Share of each joint in the squared departure beyond the noise.

    Args:
        rests: recorded minus predicted positions of each trial, ``(T, J)`` [rad].
        names: of the joints.
        sigma: of the readings [rad].
    """
    square = np.nanmean(np.vstack(rests) ** 2, axis=0) - sigma**2
    square = np.maximum(square, 0.0) + 1e-3 * sigma**2
    return dict(zip(names, (square / square.sum()).tolist(), strict=True))


def suspects(
    rests: Sequence[np.ndarray], names: Sequence[str], sigma: float
) -> Suspects:
    """Joints and legs to be considered.

    Args:
        rests: recorded minus predicted positions of each trial, ``(T, J)`` [rad].
        names: of the joints.
        sigma: of the readings [rad].
    """
    share = shares(rests, names, sigma)
    by_leg = {
        leg: sum(value for name, value in share.items() if name.startswith(leg))
        for leg in legs_of(names)
    }
    legs = sorted(by_leg, key=by_leg.__getitem__, reverse=True)
    worst = by_leg[legs[0]]
    near = tuple(leg for leg in legs[:2] if by_leg[leg] >= NEARLY * worst)
    own = [name for name in share if name.startswith(near)]
    joints = sorted(own, key=share.__getitem__, reverse=True)
    return Suspects(tuple(joints) if worst > LEAST else (), near, worst < MOST)
