"""What robots can be told, for learners that need it: channels and their limits."""

from typing import NamedTuple

import numpy as np

from bns import models
from bns.worlds.trial import Channel


class Told(NamedTuple):
    """Commands of a robot.

    Attributes:
        kind: "wheeled", "legged" or "servo".
        channels: the C commanded quantities.
        ranges: smallest and largest value of each, ``(C, 2)``, SI units.
    """

    kind: str
    channels: tuple[Channel, ...]
    ranges: np.ndarray


def told(name: str) -> Told:
    """What the robot called `name` can be told.

    Raises:
        UnknownNameError: there is none.
    """
    robot = models.robot(name)
    channels = tuple(Channel(*channel) for channel in robot.channels)
    return Told(robot.kind, channels, robot.ranges)
