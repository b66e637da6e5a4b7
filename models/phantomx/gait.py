"""A tripod gait by hand: what a walking learner has to beat.

Three legs swing forward in the air while the other three push back, then they are put
down; every second command is a step. Feet move along x on straight lines, computed by
inverse kinematics, so that standing feet do not slip against each other.
"""

import contextlib
from typing import NamedTuple

import numpy as np

from bns.errors import BnsError, OutOfBoundsError
from bns.models.legs import JOINTS
from bns.models.phantomx import kinematics

ONE_SET = np.array([True, False, True, False, False, True])
"""the legs that swing first: 1, 3 and 6"""


class Tripod(NamedTuple):
    """Numbers of the gait.

    Attributes:
        stride: way of a foot on the ground in a step [m].
        lift: of a swinging foot [m].
        reach: of the feet from the hips, in mid-stride [m].
        height: of the hips above the feet [m].
    """

    stride: float = 0.16
    lift: float = 0.06
    reach: float = 0.13
    height: float = 0.14


BEST = Tripod()
"""the farthest in eleven commands of a grid of such gaits whose legs do not touch
(`python -m bench hexapod-tripod`)"""


def tripod(gait: Tripod = BEST, *, commands: int = 11, heading: int = 1) -> np.ndarray:
    """Servo goals of the gait, from the half-way stance.

    Args:
        gait: its numbers.
        commands: how many.
        heading: 1 walks forward, -1 backward.

    Returns:
        Shape ``(commands, 18)`` [rad], within the end stops.

    Raises:
        BnsError: a foot out of reach.
        OutOfBoundsError: an angle beyond a servo's end stops.
    """
    s = kinematics.shape()
    out = np.column_stack([np.sin(s.heading), s.side * np.cos(s.heading)])
    stance = np.column_stack([s.hips + gait.reach * out, np.full(6, -gait.height)])
    goals, ahead = [], np.zeros(6)
    for command in range(commands):
        swing = ONE_SET if command // 2 % 2 == 0 else ~ONE_SET
        raised = gait.lift * swing if command % 2 == 0 else np.zeros(6)
        if command % 2 == 0:
            ahead = heading * gait.stride / 2 * np.where(swing, 1, -1)
        feet = stance + np.column_stack([ahead, np.zeros(6), raised])
        goals.append(kinematics.goals(feet))
    return _within_stops(np.array(goals))


def drawn(
    rng: np.random.Generator, *, commands: int = 11, heading: int = 1
) -> np.ndarray:
    """Servo goals of a gait with another stride, lift, reach and height.

    Args:
        rng: the only source of randomness.
        commands, heading: as for `tripod`.

    Returns:
        Shape ``(commands, 18)`` [rad], within the end stops.
    """
    while True:
        stride, lift = rng.uniform(0.08, 0.17), rng.uniform(0.03, 0.06)
        reach, height = rng.uniform(0.12, 0.15), rng.uniform(0.12, 0.14)
        with contextlib.suppress(BnsError):  # out of reach: another one
            gait = Tripod(stride, lift, reach, height)
            return tripod(gait, commands=commands, heading=heading)


def _within_stops(goals: np.ndarray) -> np.ndarray:
    from bns import models

    low, high = models.robot("phantomx").ranges.T
    beyond = np.argwhere((goals < low) | (goals > high))
    if len(beyond):
        row, column = beyond[0]
        raise OutOfBoundsError(
            f"tripod: command {row}: {JOINTS[column]}",
            round(float(goals[row, column]), 4),
            low[column],
            high[column],
            "rad",
        )
    return goals
