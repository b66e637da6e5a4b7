"""Paths between known poses: a constant turn and speed from each to the next."""

import numpy as np

from bns.worlds.trial import body_displacements

_STRAIGHT = 1e-6
"""rad; a smaller turn is drawn as a straight line"""

_FULL = 5.0
"""rad; from here on as well: near a full turn no arc of moderate size fits"""


def listed(poses: np.ndarray) -> np.ndarray:
    """The rows before the first one with a NaN, ``(K + 1, 3)``."""
    lost = ~np.isfinite(poses).all(axis=1)
    return poses[: int(lost.argmax()) if lost.any() else len(poses)]


def arcs(poses_world: np.ndarray, per_step: int = 8) -> np.ndarray:
    """Poses along the arcs that join successive poses.

    Args:
        poses_world: ``(K + 1, 3)`` finite poses [m, m, rad].
        per_step: samples per arc.

    Returns:
        ``(K * per_step + 1, 3)``.
    """
    share = np.arange(per_step) / per_step
    parts = [
        _along(start, step, share)
        for start, step in zip(
            poses_world[:-1], body_displacements(poses_world), strict=True
        )
    ]
    return np.concatenate([*parts, poses_world[-1:]])


def _along(start: np.ndarray, step: np.ndarray, share: np.ndarray) -> np.ndarray:
    """Poses at `share` of the arc that moves `start` by `step` (body frame)."""
    ahead, left, turn = step
    if not _STRAIGHT < abs(turn) < _FULL:
        moved = np.outer(share, (ahead, left))
    else:
        half = turn / 2
        scale = half / np.tan(half)
        speed = np.array([scale * ahead + half * left, scale * left - half * ahead])
        sin, cos = np.sin(share * turn) / turn, (1 - np.cos(share * turn)) / turn
        moved = np.stack(
            [sin * speed[0] - cos * speed[1], cos * speed[0] + sin * speed[1]], axis=1
        )
    c, s = np.cos(start[2]), np.sin(start[2])
    x = start[0] + c * moved[:, 0] - s * moved[:, 1]
    y = start[1] + s * moved[:, 0] + c * moved[:, 1]
    return np.stack([x, y, start[2] + share * turn], axis=1)


def dashes(points: np.ndarray, dash: float = 0.02) -> list[np.ndarray]:
    """Every other piece of length `dash` [m] of a polyline ``(N, D)``."""
    length = np.concatenate(
        [[0.0], np.cumsum(np.linalg.norm(np.diff(points, axis=0), axis=1))]
    )
    if length[-1] <= 0:
        return []
    cuts = np.arange(0.0, length[-1] + dash, dash)
    dense = np.stack([np.interp(cuts, length, column) for column in points.T], axis=1)
    return [dense[at : at + 2] for at in range(0, len(dense) - 1, 2)]
