"""Tracker noise: reported poses scatter."""

import numpy as np

from bns.worlds.effects.base import Parameter, PoseSignal, TrackingEffect


class TrackerNoise(TrackingEffect):
    """Independent normal noise on every sample of position and heading."""

    name = "tracker_noise"
    doc = "reported poses scatter"
    source = "assumed: normal and independent; a tag tracker at 1080p reaches 0.2 mm"
    robots = ("wheeled", "legged")
    random = True
    parameters = (
        Parameter(
            "position_sd",
            unit="m",
            nominal=0.0,
            low=0.0,
            high=0.1,
            doc="standard deviation of x and of y; bounds assumed",
            example=0.002,
        ),
        Parameter(
            "heading_sd",
            unit="rad",
            nominal=0.0,
            low=0.0,
            high=0.5,
            doc="standard deviation of the yaw; bounds assumed",
            example=0.01,
        ),
    )

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        poses = signal.poses.copy()
        if self.is_nominal:
            return signal.times.copy(), poses
        sd = np.array([self["position_sd"], self["position_sd"], self["heading_sd"]])
        noise = sd * rng.standard_normal(poses.shape)
        poses[active] += noise[active]
        return signal.times.copy(), poses
