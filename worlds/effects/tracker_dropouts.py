"""Tracker drop-outs: samples are lost, singly or in bursts."""

import numpy as np

from bns.worlds.effects.base import Parameter, PoseSignal, TrackingEffect


class TrackerDropouts(TrackingEffect):
    """Samples are lost (NaN) in bursts of one length that may overlap."""

    name = "tracker_dropouts"
    doc = "samples of the tracker are lost"
    source = "assumed: independent starts of bursts of equal length"
    robots = ("wheeled", "legged")
    random = True
    parameters = (
        Parameter(
            "probability",
            unit="1",
            nominal=0.0,
            low=0.0,
            high=0.99,
            doc="share of the samples that are lost; bounds assumed",
            example=0.2,
        ),
        Parameter(
            "length",
            unit="1",
            nominal=1,
            low=1,
            high=100,
            doc="samples lost in one burst; bounds assumed",
            example=1,
            integer=True,
            scales=False,
        ),
    )

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        poses = signal.poses.copy()
        if self.is_nominal:
            return signal.times.copy(), poses
        length = int(self["length"])
        # A sample survives if no burst began at it or up to length - 1 before it.
        begin = 1 - (1 - self["probability"]) ** (1 / length)
        begins = rng.random(len(poses) + length - 1) < begin
        lost = np.convolve(begins, np.ones(length, dtype=int), mode="valid") > 0
        poses[active & lost] = np.nan
        return signal.times.copy(), poses
