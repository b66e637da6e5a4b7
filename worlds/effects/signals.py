"""What effects of the command, actuator and tracking stages act on."""

from dataclasses import dataclass

import numpy as np


@dataclass(frozen=True, eq=False)
class ControlSignal:
    """What reaches a robot's actuators during one trial, on the physics grid.

    Attributes:
        times: start of each physics step [s], shape ``(S,)``.
        values: command in force at each step, shape ``(S, C)``, SI units.
        command: index of that command in the list, shape ``(S,)``; -1 after the last.
        channels: names of the C columns.
        dt: physics step [s].
    """

    times: np.ndarray
    values: np.ndarray
    command: np.ndarray
    channels: tuple[str, ...]
    dt: float

    def column(self, name: str) -> int:
        """Column index of a channel."""
        return self.channels.index(name)


@dataclass(frozen=True, eq=False)
class PoseSignal:
    """What the tracker sees during one trial: samples on the observation grid.

    Attributes:
        times: time stamps [s], shape ``(T,)``.
        poses: planar poses in the world frame, shape ``(T, 3)``; NaN = lost.
        fine_times: the physics grid [s], shape ``(S + 1,)``, for delays.
        fine_poses: true poses on it, shape ``(S + 1, 3)``.
    """

    times: np.ndarray
    poses: np.ndarray
    fine_times: np.ndarray
    fine_poses: np.ndarray
