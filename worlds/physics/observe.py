"""From physics states to what is seen of a robot: samples, poses, outcome."""

from collections.abc import Mapping, Sequence

import numpy as np

from bns.models.ax12a import HOTTEST
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


Laws = Mapping[str, np.ndarray]

SATURATED = 0.98  # share of the torque limit that counts as all of it; assumed
OVERLOAD_TIME = 1.0  # [s] at the limit until the servo gives up; assumed
STALLED = 0.1  # [rad/s] slower = it pushes in vain; assumed
HEAT_CAPACITY = 50.0  # [J/K] 54.6 g of copper, steel and plastic; assumed
LYING = 0.002  # [m] height of the belly or a hip at which the robot lies; assumed
AMBIENT = 40.0  # [deg C] of the servos at the start of a trial; assumed


def legged_outcome(
    free: np.ndarray,
    angles: np.ndarray,
    speeds: np.ndarray,
    goals: np.ndarray,
    laws: dict[str, np.ndarray],
    carried: np.ndarray,
    *,
    dt: float,
    arena: tuple[float, float],
    touched: bool,
    rested: bool,
    diverged: bool,
) -> Outcome:
    """The flags of a trial.

    Args:
        free: the base's free joint on the physics grid, shape ``(S + 1, 7)``.
        angles, speeds: of the servos, shape ``(L, C)`` [rad, rad/s].
        goals: in force then, shape ``(L, C)`` [rad].
        laws: numbers of the servos, each of shape ``(C,)``.
        carried: what may not touch the floor, see `lies`.
        dt: between two of these L moments [s].
        arena: size of the board along x and y [m], centred on the origin.
        touched: whether the robot's own parts touched.
        rested: whether every command ended at rest.
        diverged: whether the physics did.
    """
    duty = _duty(goals, angles, laws)
    pushing = (np.abs(duty) > SATURATED * laws["duty_limit"]) & (
        np.abs(speeds) < STALLED
    )
    seen = outcome(free, arena, diverged)
    return seen._replace(
        fell=seen.fell or lies(free, carried),
        collided=touched,
        unrested=not rested,
        overloaded=_for_long(pushing & (laws["powered"] > 0), OVERLOAD_TIME / dt),
        overheated=bool((_heated(duty, speeds, laws, dt) > HOTTEST).any()),
    )


def lies(free: np.ndarray, carried: np.ndarray) -> bool:
    """Whether the body or a hip is on the floor at some time.

    Args:
        free: the base's free joint, shape ``(S, 7)``.
        carried: balls around points of the base that legs should carry: x, y, z and
            radius, shape ``(P, 4)`` [m].
    """
    w, i, j, k = free[:, 3:].T
    up = 2 * np.array([i * k - w * j, j * k + w * i, 0.5 - i * i - j * j])
    heights = carried[:, :3] @ up + free[:, 2] - carried[:, 3:]
    return bool((heights < LYING).any())


def _duty(goals: np.ndarray, angles: np.ndarray, laws: Laws) -> np.ndarray:
    """Share of the supply on each motor, shape ``(S, C)``."""
    wanted = laws["gain"] * laws["error_gain"] * (goals - angles)
    return np.clip(wanted, -laws["duty_limit"], laws["duty_limit"]) * laws["powered"]


def _heated(duty: np.ndarray, speeds: np.ndarray, laws: Laws, dt: float) -> np.ndarray:
    """Servos' temperatures at the end if none is given off, shape ``(C,)`` [deg C]."""
    driving = duty * laws["voltage"] - laws["torque_constant"] * speeds * (duty != 0)
    heat = np.nansum(driving**2, axis=0) / laws["resistance"] * dt  # [J]
    return AMBIENT + heat / HEAT_CAPACITY


def _for_long(on: np.ndarray, steps: float) -> bool:
    """Whether a column is true for so many steps on end."""
    count = max(round(steps), 1)
    if len(on) < count:
        return False
    total = np.vstack([np.zeros((1, on.shape[1]), int), np.cumsum(on, axis=0)])
    return bool((total[count:] - total[:-count] == count).any())
