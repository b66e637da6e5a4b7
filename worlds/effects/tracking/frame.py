"""Where the tracker sees the robot: its frame, its unit of length."""

import numpy as np

from bns.worlds.effects.base import Parameter, PoseSignal, TrackingEffect


class TrackerRotation(TrackingEffect):
    """Poses are turned about the middle of the board."""

    name = "tracker_rotation"
    doc = "the tracker's frame is turned against the board's"
    source = "assumed: a camera mounted askew"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "angle",
            unit="rad",
            nominal=0.0,
            low=-0.8,
            high=0.8,
            doc="turn of the reported poses, counter-clockwise; bounds assumed",
            example=0.1,
        ),
    )

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        poses = signal.poses.copy()
        if self.is_nominal:
            return signal.times.copy(), poses
        cos, sin = np.cos(self["angle"]), np.sin(self["angle"])
        x, y, yaw = signal.poses[active].T
        poses[active] = np.stack(
            [cos * x - sin * y, sin * x + cos * y, yaw + self["angle"]], axis=1
        )
        return signal.times.copy(), poses


class TrackerScale(TrackingEffect):
    """Positions are scaled about the middle of the board; headings are right."""

    name = "tracker_scale"
    doc = "the tracker's unit of length is wrong"
    source = "assumed: wrong camera height or tag height"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "factor",
            unit="1",
            nominal=1.0,
            low=0.8,
            high=1.25,
            doc="length reported over true length; bounds assumed",
            example=1.05,
        ),
    )

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        poses = signal.poses.copy()
        poses[active, :2] *= self["factor"]
        return signal.times.copy(), poses
