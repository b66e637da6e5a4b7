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


def lagged(
    told: np.ndarray, before: float, time_constant: float, dt: float
) -> np.ndarray:
    """What follows a signal as a first-order lag, its mean over each step, ``(S,)``.

    Solved exactly for values that are constant over a step. The mean is late by the
    time constant at any step; the value at a step's end would be early by half a step.

    Args:
        told: values, ``(S,)``.
        before: value that was followed until then.
        time_constant: [s], positive.
        dt: step [s].
    """
    from scipy.signal import lfilter

    keep = np.exp(-dt / time_constant)
    begun = lfilter([0.0, 1 - keep], [1.0, -keep], told, zi=[before])[0]
    return told + (begun - told) * (1 - keep) * time_constant / dt
