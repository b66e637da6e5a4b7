"""What a contract test of worlds needs to know of each kind of robot."""

from collections.abc import Callable
from typing import NamedTuple

import numpy as np

from bns import models
from bns.worlds import registry
from bns.worlds.trial import WHEEL_CHANNELS, Channel, Commands, Trial

STRIDE = np.tile([1.0, 0.0, 0.0], 6)  # all coxae forward [1]
LIFTED = np.array([0, 0.5, 0.2] * 6)  # femur up, tibia out [rad]
ONE_SET = np.repeat([1, 0, 1, 0, 0, 1], 3).astype(float)  # legs 1, 3, 6


class Kind(NamedTuple):
    """Commands and damages that suit a kind of robot.

    Attributes:
        channels: what it is told.
        lists: so many random lists of commands, of different lengths, from a seed.
        ahead: commands that move it ahead (1) or back (-1).
        damage: an effect as text that ahead shows.
        sides: two effects that mirror each other.
        shows: whether a trial of `ahead` is one with `damage`.
        beyond: commands of which the second one cannot be told, and what says so.
    """

    channels: tuple[Channel, ...]
    lists: Callable[[int, int], list[Commands]]
    ahead: Callable[[int], Commands]
    damage: str
    sides: tuple[str, str]
    shows: Callable[[Trial], bool]
    beyond: tuple[Commands, str]


def of(world: str) -> Kind:
    """The kind of robot of a registered world."""
    return KINDS[models.robot(registry.make(world).robot).kind]


def _wheel_lists(count: int, seed: int = 0) -> list[Commands]:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 7, count)
    return [
        Commands(rng.uniform(-0.12, 0.12, (k, 2)), rng.uniform(0.2, 1.5, k))
        for k in lengths
    ]


def _leg_lists(count: int, seed: int = 0) -> list[Commands]:
    rng = np.random.default_rng(seed)
    lengths = rng.integers(1, 5, count)
    return [
        Commands(rng.uniform(-0.4, 0.4, (k, 18)), rng.uniform(0.2, 1.5, k), LEGS)
        for k in lengths
    ]


def _steps(way: int) -> Commands:
    """Four steps of a simple tripod gait."""
    goals = []
    for swing in (ONE_SET, 1 - ONE_SET) * 2:
        placed = 0.3 * way * STRIDE * (2 * swing - 1)
        goals += [placed + LIFTED * swing, placed]
    return Commands(np.array(goals), np.full(len(goals), 1.0), LEGS)


LEGS = tuple(Channel(*item) for item in models.robot("phantomx").channels)
KINDS = {
    "wheeled": Kind(
        channels=WHEEL_CHANNELS,
        lists=_wheel_lists,
        ahead=lambda way: Commands([[0.1 * way, 0.1 * way]], [1.5]),
        damage="wheel_gain:wheel=left,factor=0.8",
        sides=(
            "wheel_gain:wheel=left,factor=0.8",
            "wheel_gain:wheel=right,factor=0.8",
        ),
        shows=lambda trial: trial.poses_world[-1, 2] > 0.1,  # it turns left
        beyond=(
            Commands([[0, 0], [0.1, 0.5]], [1, 1]),
            r"command 1: right_speed = 0\.5",
        ),
    ),
    "legged": Kind(
        channels=LEGS,
        lists=_leg_lists,
        ahead=_steps,
        damage="leg_raised:legs=5,blend=1",
        sides=("leg_raised:legs=5,blend=1", "leg_raised:legs=6,blend=1"),
        shows=lambda trial: trial.channel("left_middle_femur_position")[-1] > 1.0,
        beyond=(
            Commands([[0.0] * 18, [0.0] * 17 + [1.5]], [1, 1], LEGS),
            r"command 1: right_middle_tibia = 1\.5 rad .* from -1\.8",
        ),
    ),
}
