"""Robot models and the arena, each number with its unit and source.

A robot is a directory here that holds a `robot.toml`; adding one adds the robot.
"""

from collections.abc import Mapping
from functools import cache
from pathlib import Path
from typing import Any

from bns.errors import UnknownNameError
from bns.models.robot_model import FACTS, CommandChannel, RobotModel, Wheel, read

__all__ = [
    "CommandChannel",
    "RobotModel",
    "Wheel",
    "names",
    "path",
    "robot",
    "scene_spec",
    "spec",
]

_HERE = Path(__file__).parent


@cache
def names() -> tuple[str, ...]:
    """Names of all robots, sorted."""
    return tuple(sorted(file.parent.name for file in _HERE.glob(f"*/{FACTS}")))


@cache
def robot(name: str) -> RobotModel:
    """The robot called `name`.

    Raises:
        UnknownNameError: there is none.
    """
    if name not in names():
        raise UnknownNameError("robot", name, names())
    return read(_HERE / name)


def path(name: str) -> Path:
    """The robot's directory.

    Raises:
        UnknownNameError: there is no such robot.
    """
    return robot(name).directory


def spec(name: str, *, scene: bool = True, visuals: bool = True, **options: str) -> Any:
    """The robot as a `mujoco.MjSpec`, to be edited and compiled.

    Args:
        name: of the robot.
        scene: with a floor (geom `floor`), a light and a camera.
        visuals: with what only shows. Without, the motion is the same bit for bit and
            a step costs less.
        options: choices that the robot offers, for example `ir_table="thesis"`.

    Raises:
        UnknownNameError: no such robot, option or alternative.
    """
    from bns.models import edits

    return edits.load(robot(name), scene=scene, visuals=visuals, options=options)


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
        name: of the robot.
        objectives: places to show [m], by name.
        radius: within which an objective counts as reached [m] (thesis, Algorithm 5).
        visuals: see `spec`.
        options: see `spec`.

    Raises:
        UnknownNameError: no such robot, option or alternative.
    """
    from bns.models import arena, edits

    made = edits.load(robot(name), scene=False, visuals=visuals, options=options)
    arena.furnish(made, objectives=objectives or {}, radius=radius, visuals=visuals)
    return made
