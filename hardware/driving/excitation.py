"""Commands that show what a robot does, and keep it on the board."""

import numpy as np

from bns import seeding
from bns.worlds.trial import Commands

SPEED = 0.12  # m/s, the laboratory's controllers go up to 0.1215
AXLE = 0.0874  # m, nominal
LONGEST = 1.5  # s of a hexapod's command, which ends as it rests
ROOM = 0.55  # m from the start in any direction
START = (0.0, 0.0, 0.4)
"""m, m, rad: askew to the camera's rows. Where the tag's edges lie along them, its
place is found up to 0.3 mm off at 1080p, the same from picture to picture"""


def commands(count: int, *, seed: int, number: int) -> Commands:
    """A list of commands that stays within `ROOM` of its start, by the nominal model.

    Straight, curved and turning drives of both directions, slow and fast, long and
    short; drawn anew until the nominal robot stays near.

    Args:
        count: commands.
        seed: of the draw.
        number: of the list.
    """
    rng = seeding.generator(seed, "excitation", number)
    while True:
        values = rng.uniform(-SPEED, SPEED, (count, 2))
        straight = rng.random(count) < 0.3
        values[straight, 1] = values[straight, 0]
        spin = rng.random(count) < 0.2
        values[spin, 1] = -values[spin, 0]
        durations = rng.uniform(0.6, 2.4, count).round(2)
        if _reach(values, durations) < ROOM:
            return Commands(values, durations)


def steps(count: int, *, seed: int, number: int) -> Commands:
    """A list of commands for the hexapod: a tripod gait of its own stride and height.

    Lists go forward and backward in turn.

    Args:
        count: commands.
        seed: of the draw.
        number: of the list.
    """
    from bns import models
    from bns.models.phantomx import gait

    rng = seeding.generator(seed, "excitation of legs", number)
    goals = gait.drawn(rng, commands=count, heading=1 if number % 2 == 0 else -1)
    return Commands(
        goals, np.full(count, LONGEST), tuple(models.robot("phantomx").channels)
    )


def _reach(values: np.ndarray, durations: np.ndarray) -> float:
    """Farthest that the nominal robot gets from its start [m]."""
    x = y = yaw = far = 0.0
    for (left, right), duration in zip(values, durations, strict=True):
        for _ in range(10):
            step = duration / 10
            yaw += (right - left) / AXLE * step
            x += (left + right) / 2 * np.cos(yaw) * step
            y += (left + right) / 2 * np.sin(yaw) * step
            far = max(far, float(np.hypot(x, y)))
    return far
