"""Training patterns of a closed-loop trial, for motion and for the sensors."""

import numpy as np

from bns.learners.bns.light.simulator import Scales
from bns.learners.bns.memory import Patterns
from bns.tasks.light import lost, readings
from bns.tasks.light_controller import brightness
from bns.worlds.trial import Trial, body_displacements


def motion(trial: Trial, scales: Scales) -> Patterns:
    """What each cycle was and did, scaled: ``(N, 4)`` and ``(N, 3)``.

    Cycles in which the robot was stopped or turned are left out, and so are those
    with a lost pose; a robot that was turned goes on from rest.
    """
    speeds = trial.commands.values[:, :2] / scales.speed
    rested = np.append(True, trial.handled[:-1])
    before = np.vstack([np.zeros((1, 2)), speeds[:-1]])
    before[rested] = 0.0
    moved = body_displacements(trial.command_poses_world) / np.asarray(scales.moved)
    good = np.isfinite(moved).all(1) & ~trial.handled & trial.outcome.usable
    return Patterns(np.hstack([before, speeds])[good], moved[good])


def sensors(trial: Trial, lamp: tuple[float, float]) -> Patterns:
    """What was read where: the lamp in the robot's frame [m] and its brightness.

    Returns:
        ``(N, 2)`` ahead and left, ``(N, 2)`` left and right sensor; without those of
        a robot that was stopped for good.
    """
    poses = trial.command_poses_world
    read = readings(trial)
    good = np.isfinite(poses).all(1) & np.isfinite(read).all(1)
    good[1:] &= ~lost([trial])[0]
    good &= trial.outcome.usable
    return Patterns(in_body(poses, lamp)[good], brightness(read)[good])


def in_body(poses: np.ndarray, lamp: tuple[float, float]) -> np.ndarray:
    """Where the lamp is in the frames of robots, ``(..., 2)`` ahead and left [m]."""
    east, north = np.moveaxis(np.asarray(lamp) - poses[..., :2], -1, 0)
    cos, sin = np.cos(poses[..., 2]), np.sin(poses[..., 2])
    return np.stack([cos * east + sin * north, cos * north - sin * east], axis=-1)


def mirrored_motion(patterns: Patterns) -> Patterns:
    """The same with left and right exchanged (data augmentation)."""
    return Patterns(
        patterns.inputs[:, [1, 0, 3, 2]],
        patterns.targets * np.array([1.0, -1.0, -1.0]),
    )


def mirrored_sensors(patterns: Patterns) -> Patterns:
    """The same with left and right exchanged (data augmentation)."""
    return Patterns(
        patterns.inputs * np.array([1.0, -1.0]), patterns.targets[:, [1, 0]]
    )
