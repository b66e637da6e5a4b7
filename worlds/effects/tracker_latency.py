"""Tracker latency: the poses reported are old."""

import numpy as np

from bns.worlds.effects.base import Parameter, PoseSignal, TrackingEffect


class TrackerLatency(TrackingEffect):
    """A sample stamped t shows the pose at t - delay; before the start, the first.

    What other tracking effects did to the poses before is kept: the motion during the
    delay is taken away from them.
    """

    name = "tracker_latency"
    doc = "the tracker reports old poses under new time stamps"
    source = "assumed: exposure, transfer and image processing of an overhead camera"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "delay",
            unit="s",
            nominal=0.0,
            low=0.0,
            high=2.0,
            doc="age of a reported pose; bounds assumed",
            example=0.2,
        ),
    )

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        poses = signal.poses.copy()
        if self.is_nominal:
            return signal.times.copy(), poses
        now, then = signal.times[active], signal.times[active] - self["delay"]
        for axis in range(3):
            track = signal.fine_poses[:, axis]
            poses[active, axis] += np.interp(then, signal.fine_times, track)
            poses[active, axis] -= np.interp(now, signal.fine_times, track)
        return signal.times.copy(), poses
