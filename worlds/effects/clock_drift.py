"""Clock drift: the tracker's clock is fast or slow."""

import numpy as np

from bns.worlds.effects.base import Parameter, PoseSignal, TrackingEffect


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
        times = signal.times.copy()
        if self.is_nominal:
            return times, signal.poses.copy()
        on = np.diff(times, prepend=times[:1]) * active  # [s] on before each sample
        times += self["rate"] * np.cumsum(on)
        return times, signal.poses.copy()
