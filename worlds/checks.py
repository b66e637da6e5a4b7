"""Checks of what every world is given."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import Any, TypeVar

import numpy as np

from bns.errors import BnsError, OutOfBoundsError, UnknownNameError
from bns.models.robot_model import RobotModel
from bns.worlds.damage import Damage

T = TypeVar("T")

WORLDS = {"wheeled": ("mujoco", "khepera3"), "legged": ("hexapod", "phantomx")}
"""by kind of robot, the physics world that it moves in, and a robot of the kind"""


def of_kind(kind: str, robot: RobotModel) -> RobotModel:
    """The robot, if it is of a kind.

    Raises:
        BnsError: it is not.
    """
    if robot.kind != kind:
        _, usual = WORLDS[kind]
        fit, _ = WORLDS.get(robot.kind, ("", ""))
        other = f", or the world {fit!r}" if fit else ""
        raise BnsError(
            f"Robot {robot.name!r} is {robot.kind}, this world is for {kind} ones: "
            f"take {usual!r} or the directory of one of your own{other}."
        )
    return robot


def bounded(name: str, value: float, low: float, high: float, unit: str) -> float:
    """The number, if it is inside its bounds.

    Args:
        name: what the number is called, for the message.
        value: the number.
        low: smallest that is allowed.
        high: largest that is allowed.
        unit: of all three, for the message.

    Raises:
        OutOfBoundsError: it is not, or it is no number.
    """
    try:
        number = float(value)
    except (TypeError, ValueError):
        number = np.nan
    if not low <= number <= high:
        raise OutOfBoundsError(name, value, low, high, unit)
    return number


def checked_start(
    start: Sequence[float], arena: tuple[float, float]
) -> tuple[float, float, float]:
    """The start pose, if it is inside the arena.

    Raises:
        BnsError: it is not three numbers.
        OutOfBoundsError: it is not.
    """
    if len(start) != 3:
        raise BnsError(f"start = {start} is not allowed: give (x, y, yaw) [m, m, rad].")
    x, y, yaw = start
    return (
        bounded("start x", x, -arena[0] / 2, arena[0] / 2, "m"),
        bounded("start y", y, -arena[1] / 2, arena[1] / 2, "m"),
        bounded("start yaw", yaw, -1e3, 1e3, "rad"),
    )


def shared(
    damage: Damage | tuple[Damage, ...], seeds: Sequence[int], robots: int
) -> tuple[Sequence[Damage], Sequence[int]]:
    """A damage and a seed for each of the robots; without seeds 0, 1, 2, ...

    Args:
        damage: one for all robots, or one for each.
        seeds: one for each robot, or none.
        robots: how many there are.

    Raises:
        BnsError: there are other numbers of them, or a negative seed.
    """
    if isinstance(damage, Damage):
        damage = (damage,) * robots
    if len(damage) != robots:
        raise BnsError(
            f"{len(damage)} damages were given for {robots} robots: give one for "
            "each, or a single one for all."
        )
    seeds = [int(seed) for seed in seeds] if len(seeds) else list(range(robots))
    if len(seeds) != robots or min(seeds, default=0) < 0:
        raise BnsError(
            f"seeds has {len(seeds)} entries for {robots} robots: give one "
            "non-negative whole number for each, or none."
        )
    return damage, seeds


def several(kind: type[T], name: str, given: Any) -> tuple[T, ...]:
    """One or more of a kind, each as itself or as a table with its fields.

    Args:
        kind: a dataclass.
        name: what one of it is called, for messages.
        given: one, or a sequence of them.

    Raises:
        BnsError: it is no such thing.
    """
    alone = isinstance(given, kind | Mapping) or not isinstance(given, Sequence)
    return tuple(one(kind, name, item) for item in ((given,) if alone else given))


def one(kind: type[T], name: str, given: object) -> T:
    """One of a kind, as itself or as a table with its fields; see `several`.

    Args:
        kind: a dataclass.
        name: what one of it is called, for messages.
        given: one of the kind, or a table with its fields.

    Raises:
        BnsError: it is neither, or the kind does not take its fields.
        UnknownNameError: a field that the kind does not have.
    """
    if isinstance(given, kind):
        return given
    known = [field.name for field in fields(kind)]  # type: ignore[arg-type]
    if not isinstance(given, Mapping):
        raise BnsError(
            f"{given!r} is no {name}: give a {kind.__name__} or a table with "
            f"{', '.join(known)}."
        )
    for key in given:
        if key not in known:
            raise UnknownNameError(f"field of a {name}", str(key), known)
    try:
        return kind(**given)
    except TypeError as error:
        raise BnsError(f"{dict(given)!r} is no {name}: {error}.") from error
