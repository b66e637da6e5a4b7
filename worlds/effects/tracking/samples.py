"""What becomes of the tracker's samples: noise, loss, age, clock."""

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
        """See `TrackingEffect.apply`."""
        poses = signal.poses.copy()
        if self.is_nominal:
            return signal.times.copy(), poses
        sd = np.array([self["position_sd"], self["position_sd"], self["heading_sd"]])
        noise = sd * rng.standard_normal(poses.shape)
        poses[active] += noise[active]
        return signal.times.copy(), poses


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
        """See `TrackingEffect.apply`."""
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
        """See `TrackingEffect.apply`."""
        poses = signal.poses.copy()
        if self.is_nominal:
            return signal.times.copy(), poses
        now, then = signal.times[active], signal.times[active] - self["delay"]
        for axis in range(3):
            track = signal.fine_poses[:, axis]
            poses[active, axis] += np.interp(then, signal.fine_times, track)
            poses[active, axis] -= np.interp(now, signal.fine_times, track)
        return signal.times.copy(), poses


class ClockDrift(TrackingEffect):
    """Time stamps gain on true time while the effect is on, and keep what they gained.

    The clock is right at the start of each trial. List it after `tracker_latency`,
    which looks poses up by their time stamps.
    """

    name = "clock_drift"
    doc = "the tracker's clock is fast or slow"
    source = "assumed: a constant rate; crystals reach 1e-4, the rest is software"
    robots = ("wheeled", "legged")
    parameters = (
        Parameter(
            "rate",
            unit="1",
            nominal=0.0,
            low=-0.1,
            high=0.1,
            doc="seconds gained per second; bounds assumed",
            example=0.02,
        ),
    )

    def apply(
        self, signal: PoseSignal, active: np.ndarray, rng: np.random.Generator
    ) -> tuple[np.ndarray, np.ndarray]:
        """See `TrackingEffect.apply`."""
        times = signal.times.copy()
        if self.is_nominal:
            return times, signal.poses.copy()
        on = np.diff(times, prepend=times[:1]) * active  # [s] on before each sample
        times += self["rate"] * np.cumsum(on)
        return times, signal.poses.copy()
