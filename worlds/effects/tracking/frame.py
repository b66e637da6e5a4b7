"""Where the tracker sees the robot: its frame, its unit of length."""

import numpy as np
from numpy.random import Generator

from bns.worlds.effects.base import (
    Parameter,
    PoseSignal,
    TrackingEffect,
    factor,
    strength,
)


class TrackerRotation(TrackingEffect):
    """The tracker's frame is turned against the board's."""

    name = "tracker_rotation"
    source = "assumed: a camera mounted askew"
    robots = ("wheeled", "legged")
    parameters = (
        strength(
            "angle",
            "rad",
            (-0.8, 0.8),
            "turn of the reported poses, counter-clockwise; bounds assumed",
            example=0.1,
        ),
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        cos, sin = np.cos(self["angle"]), np.sin(self["angle"])
        x, y, yaw = signal.poses[active].T
        signal.poses[active] = np.stack(
            [cos * x - sin * y, sin * x + cos * y, yaw + self["angle"]], axis=1
        )


class TrackerScale(TrackingEffect):
    """The tracker's unit of length is wrong."""

    name = "tracker_scale"
    source = "assumed: wrong camera height or tag height"
    robots = ("wheeled", "legged")
    parameters = (
        factor(
            (0.8, 1.25),
            "length reported over true length; bounds assumed",
            example=1.05,
        ),
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        signal.poses[active, :2] *= self["factor"]


def _off(name: str, unit: str, high: float, doc: str, example: float) -> Parameter:
    return Parameter(
        name,
        unit=unit,
        nominal=0.0,
        low=-high,
        high=high,
        doc=f"{doc}; bounds assumed",
        example=example,
    )


class TrackerShift(TrackingEffect):
    """The tracker's frame lies beside the board's."""

    name = "tracker_shift"
    source = "assumed: a camera mounted off-centre"
    robots = ("wheeled", "legged")
    parameters = (
        _off("dx", "m", 1.0, "added to x", 0.05),
        _off("dy", "m", 1.0, "added to y", -0.03),
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        signal.poses[active, :2] += np.array([self["dx"], self["dy"]])


class MarkerMount(TrackingEffect):
    """The marker on the robot is off its centre, or turned."""

    name = "marker_mount"
    source = "rigid-body kinematics; a marker glued askew"
    robots = ("wheeled", "legged")
    parameters = (
        _off("dx", "m", 0.2, "ahead of the robot's centre", 0.01),
        _off("dy", "m", 0.2, "to the left of the robot's centre", -0.005),
        _off("yaw", "rad", np.pi, "turned counter-clockwise", 0.05),
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        x, y, yaw = signal.poses[active].T
        cos, sin = np.cos(yaw), np.sin(yaw)
        dx, dy = self["dx"], self["dy"]
        signal.poses[active] = np.stack(
            [x + cos * dx - sin * dy, y + sin * dx + cos * dy, yaw + self["yaw"]],
            axis=1,
        )
