"""Robot models and the arena, each number with its unit and source.

A robot is a directory that holds a `robot.toml`. Those here have a name, and so have
those of packages that register theirs by the entry point `bns.models`; any other is
given by its path (docs/your_robot.md).
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from bns.models.robot_model import (
    CommandChannel,
    RobotModel,
    Wheel,
    find,
    known,
    names,
    read,
)

__all__ = [
    "CommandChannel",
    "RobotModel",
    "Wheel",
    "known",
    "names",
    "path",
    "robot",
    "scene_spec",
    "spec",
]


@cache
def robot(name: str) -> RobotModel:
    """The robot called `name`, or the one whose directory that is.

    Raises:
        UnknownNameError: there is none.
        FormatError: the directory describes no robot.
    """
    return read(find(name))


def path(name: str) -> Path:
    """The robot's directory.

    Raises:
        UnknownNameError: there is no such robot.
    """
    return robot(name).directory


def spec(name: str, *, scene: bool = True, visuals: bool = True, **options: str) -> Any:
    """The robot as a `mujoco.MjSpec`, to be edited and compiled.

    Args:
        name: of the robot, or its directory.
        scene: with a floor (geom `floor`), a light and a camera.
        visuals: with what only shows. Without, the motion is the same bit for bit and
            a step costs less.
        options: choices that the robot offers, for example `ir_table="thesis"`.

    Raises:
        UnknownNameError: no such robot, option or alternative.
    """
    from bns.models import mjcf

    return mjcf.robot_spec(robot(name), scene=scene, visuals=visuals, options=options)


def scene_spec(
    name: str,
    *,
    objectives: Mapping[str, tuple[float, float]] | None = None,
    radius: float = 0.09,
    visuals: bool = True,
    **options: str,
) -> Any:
    """The robot on the arena's board, as a `mujoco.MjSpec`.

    Args:
        name: of the robot, or its directory.
        objectives: places to show [m], by name.
        radius: within which an objective counts as reached [m] (thesis, Algorithm 5).
        visuals: see `spec`.
        options: see `spec`.

    Raises:
        UnknownNameError: no such robot, option or alternative.
    """
    from bns.models import arena, mjcf

    made = mjcf.robot_spec(robot(name), scene=False, visuals=visuals, options=options)
    arena.furnish(made, objectives=objectives or {}, radius=radius, visuals=visuals)
    return made
