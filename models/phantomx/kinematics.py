"""Where the hexapod's feet are for given joint angles, and the angles for given feet.

Positions are in the base's frame (x forward, y left, z up; origin in the middle of the
hips), angles as goals are (`servos`).
"""

from functools import cache
from pathlib import Path
from typing import Any, NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.models import numbers
from bns.models.legs import LEGS


class Shape(NamedTuple):
    """The hexapod's lengths and zeros.

    Attributes:
        hips: of the six legs, shape ``(6, 2)`` [m].
        side: 1 for left legs, -1 for right ones, shape ``(6,)``.
        heading: of a leg half-way, forward of the lateral axis, shape ``(6,)`` [rad].
        coxa, femur, tibia: lengths [m].
        femur_zero: of the femur half-way, above the horizontal [rad].
        knee_zero: of the tibia half-way, above the femur's line [rad].
        belly: corners of the body's underside, shape ``(4, 3)`` [m].
    """

    hips: np.ndarray
    side: np.ndarray
    heading: np.ndarray
    coxa: float
    femur: float
    tibia: float
    femur_zero: float
    knee_zero: float
    belly: np.ndarray


@cache
def shape() -> Shape:
    """The model's lengths and zeros (`numbers.toml`)."""
    table = numbers.read(Path(__file__).parent)
    value: dict[str, Any] = {name: item.value for name, item in table.items()}
    side = np.array([1 if leg.startswith("left") else -1 for leg in LEGS])
    ends = {"front": 1, "rear": -1, "middle": 0}
    ahead = np.array([ends[leg.rpartition("_")[2]] for leg in LEGS])
    out = np.where(ahead == 0, value["hip_middle_side"], value["hip_side"])
    size = [value[f"belly_{name}"] / 2 for name in ("length", "width", "height")]
    corners = [(1, 1, -1), (1, -1, -1), (-1, 1, -1), (-1, -1, -1)]
    return Shape(
        hips=np.column_stack([ahead * value["hip_forward"], side * out]),
        side=side,
        heading=ahead * value["corner_heading"],
        coxa=value["coxa_length"],
        femur=value["femur_length"],
        tibia=value["tibia_length"],
        femur_zero=value["femur_zero"],
        knee_zero=value["knee_zero"],
        belly=np.array(corners) * size,
    )


def feet(goals: np.ndarray) -> np.ndarray:
    """Positions of the six feet.

    Args:
        goals: joint angles, shape ``(..., 18)`` [rad].

    Returns:
        Shape ``(..., 6, 3)`` [m].
    """
    s, angles = shape(), np.reshape(goals, (*np.shape(goals)[:-1], 6, 3))
    heading = s.heading + angles[..., 0]
    femur = s.femur_zero + angles[..., 1]
    tibia = femur + s.knee_zero + angles[..., 2]
    reach = s.coxa + s.femur * np.cos(femur) + s.tibia * np.cos(tibia)
    return np.stack(
        [
            s.hips[:, 0] + np.sin(heading) * reach,
            s.hips[:, 1] + s.side * np.cos(heading) * reach,
            s.femur * np.sin(femur) + s.tibia * np.sin(tibia),
        ],
        axis=-1,
    )


def contacts(goals: np.ndarray) -> np.ndarray:
    """What may touch the floor: the six feet, then the belly's corners.

    Args:
        goals: joint angles, shape ``(..., 18)`` [rad].

    Returns:
        Shape ``(..., 10, 3)`` [m].
    """
    found = feet(goals)
    belly = shape().belly
    corners = np.broadcast_to(belly, (*found.shape[:-2], *belly.shape))
    return np.concatenate([found, corners], axis=-2)


def goals(feet: np.ndarray) -> np.ndarray:
    """Joint angles that bring the feet to positions, knees up.

    Args:
        feet: shape ``(..., 6, 3)`` [m].

    Returns:
        Shape ``(..., 18)`` [rad]; end stops are not looked at.

    Raises:
        BnsError: a foot is out of a leg's reach.
    """
    s, feet = shape(), np.asarray(feet, dtype=np.float64)
    away = feet[..., :2] - s.hips
    heading = np.arctan2(away[..., 0], s.side * away[..., 1])
    out, up = np.hypot(away[..., 0], away[..., 1]) - s.coxa, feet[..., 2]
    square = out**2 + up**2
    cosine = (square - s.femur**2 - s.tibia**2) / (2 * s.femur * s.tibia)
    if not (np.abs(cosine) <= 1).all():
        worst = np.sqrt(square.flat[int(np.nanargmax(np.abs(cosine)))])
        farthest, nearest = s.femur + s.tibia, abs(s.femur - s.tibia)
        raise BnsError(
            f"A foot is {worst:.3f} m from its femur axis; give positions "
            f"{nearest:.3f} to {farthest:.3f} m from it."
        )
    bend = np.arccos(cosine)
    lift = np.arctan2(s.tibia * np.sin(bend), s.femur + s.tibia * np.cos(bend))
    angles = [
        heading - s.heading,
        np.arctan2(up, out) + lift - s.femur_zero,
        -bend - s.knee_zero,
    ]
    made = np.stack(angles, axis=-1)
    return made.reshape(*made.shape[:-2], 18)
