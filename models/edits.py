"""Robots loaded from their files, with what `models.spec` was asked for."""

from collections.abc import Mapping
from typing import Any

import numpy as np

from bns.errors import UnknownNameError
from bns.models import mjcf
from bns.models.robot_model import RobotModel


def load(
    robot: RobotModel, *, scene: bool, visuals: bool, options: Mapping[str, str]
) -> Any:
    """The robot's `mujoco.MjSpec`, its options applied.

    Args:
        robot: the robot's files and options.
        scene: with a floor, a light and a camera; False = the robot alone.
        visuals: with what only shows; False = see `strip`.
        options: chosen alternative by option; the others stay as in the file.

    Raises:
        UnknownNameError: an option or alternative that the robot does not offer.
        FormatError: a file that is missing or that MuJoCo cannot read.
    """
    for name, value in options.items():
        if name not in robot.options:
            raise UnknownNameError(f"option of {robot.name}", name, robot.options)
        if value not in robot.options[name].headings:
            raise UnknownNameError(name, value, robot.options[name].headings)
    file = robot.scene if scene else robot.xml
    spec = mjcf.load(file)
    for name, value in options.items():
        for site, heading in robot.options[name].headings[value].items():
            _look(spec.site(site), np.radians(heading))
    if not visuals:
        strip(spec)
    return spec


def _look(site: Any, heading: float) -> None:
    """Turn a site so that its z axis is horizontal at `heading` [rad]."""
    half = np.sqrt(0.5)  # cos and sin of 90 / 2 deg, from straight up to the horizon
    cos, sin = np.cos(heading / 2), np.sin(heading / 2)
    site.alt.type = 0  # the quaternion holds, not the euler angles of the file
    site.quat = [half * cos, -half * sin, half * cos, half * sin]


def strip(spec: Any) -> None:
    """Delete what only shows: geoms that touch nothing, lights, cameras."""
    for geom in list(spec.geoms):
        if not (geom.contype or geom.conaffinity):
            spec.delete(geom)
    for item in [*spec.lights, *spec.cameras]:
        spec.delete(item)
