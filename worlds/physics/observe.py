"""From physics states to what is seen of a robot: samples, poses, outcome."""

from collections.abc import Sequence

import numpy as np

from bns.worlds.active import Placed
from bns.worlds.effects.base import PoseSignal, TrackingEffect
from bns.worlds.trial import Outcome

FALLEN = np.deg2rad(30.0)  # tilt at which a robot counts as fallen; assumed
TURN = 2 * np.pi


def sample_steps(counts: np.ndarray, every: float) -> tuple[np.ndarray, np.ndarray]:
    """Physics steps after which the robot is observed.

    Args:
        counts: steps of each command, shape ``(K,)``.
        every: steps between two samples, a real number from 1 on.

    Returns:
        steps, shape ``(T,)``, increasing, from 0: every so many steps and at each
        command's end; and the index of the start and of the ends, shape ``(K + 1,)``.
    """
    ends = np.concatenate([[0], np.cumsum(counts)])
    grid = np.rint(np.arange(0, ends[-1] / every + 1) * every).astype(np.int64)
    steps = np.union1d(grid[grid <= ends[-1]], ends)
    return steps, np.searchsorted(steps, ends)


def planar(free: np.ndarray, yaw: float) -> np.ndarray:
    """Planar poses with a continuous yaw.

    Args:
        free: position and orientation (w, x, y, z) of a free joint on the physics
            grid, shape ``(S, 7)``.
        yaw: of the first [rad], any number of turns.

    Returns:
        ``(S, 3)`` [m, m, rad]; NaN where `free` is.
    """
    poses = flat(free)
    step = np.diff(poses[:, 2], prepend=yaw)
    poses[:, 2] -= TURN * np.cumsum(np.rint(step / TURN))
    return poses


def flat(free: np.ndarray) -> np.ndarray:
    """Planar poses, the yaw from -pi to pi, of a free joint; shapes as for `planar`."""
    w, x, y, z = free[:, 3:].T
    angle = np.arctan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    return np.column_stack([free[:, :2], angle])


def outcome(free: np.ndarray, arena: tuple[float, float], diverged: bool) -> Outcome:
    """What happened to the robot.

    Args:
        free: its free joint on the physics grid, shape ``(S, 7)``; NaN = invalid.
        arena: size of the board along x and y [m], centred on the origin.
        diverged: whether the physics did.
    """
    half = np.asarray(arena) / 2
    left = (np.abs(free[:, :2]) > half).any()
    upright = 1 - 2 * (free[:, 4] ** 2 + free[:, 5] ** 2)  # cosine of the tilt
    return Outcome(
        left_arena=bool(left),
        fell=bool((upright < np.cos(FALLEN)).any()),
        diverged=diverged,
    )


def watched(
    poses: np.ndarray,
    sampled: np.ndarray,
    *,
    dt: float,
    effects: Sequence[Placed[TrackingEffect]],
    seed: int,
    trial: int,
) -> tuple[np.ndarray, np.ndarray]:
    """What the tracker reports of a robot's way on the physics grid.

    Args:
        poses: true ones at each step, shape ``(S, 3)``.
        sampled: steps that are samples, shape ``(T,)``.
        dt: physics step [s].
        effects: tracking effects, in the order in which they act.
        seed, trial: of their generators.

    Returns:
        time stamps ``(T,)`` and poses ``(T, 3)``.
    """
    grid = np.arange(len(poses)) * dt
    return tracked(poses[sampled], grid[sampled], poses, grid, effects, seed, trial)


def tracked(
    poses: np.ndarray,
    times: np.ndarray,
    fine_poses: np.ndarray,
    fine_times: np.ndarray,
    effects: Sequence[Placed[TrackingEffect]],
    seed: int,
    trial: int,
) -> tuple[np.ndarray, np.ndarray]:
    """What the tracker reports.

    Args:
        poses: true poses of the samples, shape ``(T, 3)``.
        times: of the samples [s], shape ``(T,)``.
        fine_poses: true poses on a finer grid, shape ``(S, 3)``.
        fine_times: of that grid [s], shape ``(S,)``.
        effects: tracking effects, in the order in which they act.
        seed, trial: of their generators.

    Returns:
        time stamps ``(T,)`` and poses ``(T, 3)``.
    """
    stamps = times
    for placed in effects:
        given = PoseSignal(stamps, poses, fine_times, fine_poses)
        rng = placed.generator(seed, trial)
        stamps, poses = placed.effect.apply(given, placed.active(times), rng)
    return stamps, poses
