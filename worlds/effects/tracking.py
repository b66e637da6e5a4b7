"""The tracker: its frame, its unit of length; its samples' noise, loss, age, clock."""

import numpy as np
from numpy.random import Generator

from bns.worlds.effects import parts
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
    parameter = strength(
        "angle",
        "rad",
        (-0.8, 0.8),
        "turn of the reported poses, counter-clockwise; bounds assumed",
        example=0.1,
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
    parameter = factor(
        (0.8, 1.25), "length reported over true length; bounds assumed", example=1.05
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        signal.poses[active, :2] *= self["factor"]


def _off(name: str, unit: str, high: float, doc: str, example: float) -> Parameter:
    doc = f"{doc}; bounds assumed"
    return strength(name, unit, (-high, high), doc, example=example)


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
    robots = parts.ANY
    choices = parts.part("place")
    parameters = (
        _off("dx", "m", 0.2, "ahead of the robot's centre", 0.01),
        _off("dy", "m", 0.2, "to the left of the robot's centre", -0.005),
        _off("yaw", "rad", np.pi, "turned counter-clockwise", 0.05),
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        parts.among([signal.place], self["part"], "tracked place")
        x, y, yaw = signal.poses[active].T
        cos, sin = np.cos(yaw), np.sin(yaw)
        dx, dy = self["dx"], self["dy"]
        signal.poses[active] = np.stack(
            [x + cos * dx - sin * dy, y + sin * dx + cos * dy, yaw + self["yaw"]],
            axis=1,
        )


class TrackerNoise(TrackingEffect):
    """Reported poses scatter."""

    name = "tracker_noise"
    source = "assumed: normal and independent; a tag tracker at 1080p reaches 0.2 mm"
    robots = ("wheeled", "legged")
    random = True
    parameters = (
        strength(
            "position_sd",
            "m",
            (0.0, 0.1),
            "standard deviation of x and of y; bounds assumed",
            example=0.002,
        ),
        strength(
            "heading_sd",
            "rad",
            (0.0, 0.5),
            "standard deviation of the yaw; bounds assumed",
            example=0.01,
        ),
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        sd = np.array([self["position_sd"], self["position_sd"], self["heading_sd"]])
        noise = sd * rng.standard_normal(signal.poses.shape)
        signal.poses[active] += noise[active]


class TrackerDropouts(TrackingEffect):
    """Samples of the tracker are lost."""

    name = "tracker_dropouts"
    source = "assumed: independent starts of bursts of equal length"
    robots = ("wheeled", "legged")
    random = True
    parameters = (
        strength(
            "probability",
            "1",
            (0.0, 0.99),
            "share of the samples that are lost; bounds assumed",
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

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        length = int(self["length"])
        # A sample survives if no burst began at it or up to length - 1 before it.
        begin = 1 - (1 - self["probability"]) ** (1 / length)
        begins = rng.random(len(signal.poses) + length - 1) < begin
        lost = np.convolve(begins, np.ones(length, dtype=int), mode="valid") > 0
        signal.poses[active & lost] = np.nan


class TrackerLatency(TrackingEffect):
    """The tracker reports old poses under new time stamps.

    What other tracking effects did to the poses before is kept: the motion during the
    delay is taken away from them.
    """

    name = "tracker_latency"
    source = "assumed: exposure, transfer and image processing of an overhead camera"
    robots = ("wheeled", "legged")
    parameter = strength(
        "delay", "s", (0.0, 2.0), "age of a reported pose; bounds assumed", example=0.2
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        now, then = signal.times[active], signal.times[active] - self["delay"]
        for axis in range(3):
            track = signal.fine_poses[:, axis]
            signal.poses[active, axis] += np.interp(then, signal.fine_times, track)
            signal.poses[active, axis] -= np.interp(now, signal.fine_times, track)


class ClockDrift(TrackingEffect):
    """The tracker's clock is fast or slow.

    The clock is right at the start of each trial. List it after `tracker_latency`,
    which looks poses up by their time stamps.
    """

    name = "clock_drift"
    source = "assumed: a constant rate; crystals reach 1e-4, the rest is software"
    robots = ("wheeled", "legged")
    parameter = strength(
        "rate",
        "1",
        (-0.1, 0.1),
        "seconds gained per second; bounds assumed",
        example=0.02,
    )

    def _change(self, signal: PoseSignal, active: np.ndarray, rng: Generator) -> None:
        times = signal.times
        on = np.diff(times, prepend=times[:1]) * active  # [s] on before each sample
        times[:] += self["rate"] * np.cumsum(on)
