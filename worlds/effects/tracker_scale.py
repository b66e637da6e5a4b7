"""Tracker scale: lengths are reported too long or too short."""

import numpy as np

from bns.worlds.effects.base import Parameter, PoseSignal, TrackingEffect


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
