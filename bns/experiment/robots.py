"""What robots can be told, for learners that need it: channels and their limits."""

import hashlib
import math
from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.task_settings import (
    SPEED_UNITS_PER_METRE_PER_SECOND,
    metres_per_second,
)
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


def contacts(name: str) -> Callable[[np.ndarray], np.ndarray]:
    """Where the feet of a robot and its belly's corners are.

    Goals ``(..., 18)`` to places ``(..., 10, 3)``, the six feet first.

    Raises:
        BnsError: that is known of the PhantomX alone.
    """
    if name != "phantomx":
        raise BnsError(
            f"walk.nominal knows the legs of 'phantomx', not those of {name!r}; leave "
            "it out."
        )
    from bns.models.phantomx import kinematics

    return kinematics.contacts


def digest(name: str) -> str:
    """What a robot's model is: 16 hexadecimal digits of all its XML and TOML files.

    Raises:
        UnknownNameError: no such robot.
    """
    directory = models.robot(name).directory
    files = sorted(p for p in directory.iterdir() if p.suffix in (".xml", ".toml"))
    held = hashlib.sha256()
    for file in files:
        held.update(file.name.encode() + b"\0" + file.read_bytes())
    return held.hexdigest()[:16]


def check_speeds(config: RunConfig) -> None:
    """Refuse speeds that a robot on wheels does not take.

    Raises:
        UnknownNameError: no such robot.
        BnsError: a speed beyond its limits.
    """
    name = config.world.robot
    robot = told(name)
    if robot.kind != "wheeled":
        return
    low, high = float(robot.ranges[:, 0].max()), float(robot.ranges[:, 1].min())
    for setting in ("speed_low", "speed_high"):
        speed = metres_per_second(getattr(config.controller, setting))
        if not low - 1e-9 <= speed <= high + 1e-9:
            limit = high if speed > high else low
            units = math.trunc(limit * SPEED_UNITS_PER_METRE_PER_SECOND)
            raise BnsError(
                f"Robot {name!r} drives at {low:g} to {high:g} m/s, and this run would "
                f"tell it {speed:.4g}: give --controller.{setting.replace('_', '-')} "
                f"{units} (units of 144 to the mm/s)."
            )
