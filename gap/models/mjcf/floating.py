"""Bodies on free joints: where they are, how they are turned, how fast both change."""

from collections.abc import Mapping
from dataclasses import replace

import mujoco
import numpy as np
from scipy.spatial.transform import Rotation

from bns.gap.models.mjcf import prepared
from bns.gap.models.mjcf.config import OwnConfig
from bns.gap.models.mjcf.described import AXES, TURNS

ORDER = "ZYX"  # yaw, pitch and roll, each about the axes that the one before has turned


def told(config: OwnConfig, model: mujoco.MjModel) -> OwnConfig:
    """A description that says which channels tell the whole state of a free body: its
    place and how it is turned, all of it, of a robot that is not left to settle.

    Args:
        config: the description.
        model: the MJCF, compiled.
    """
    ways: dict[str, set[str]] = {}
    for item in config.seen:
        if item.quantity == "body":
            ways.setdefault(item.part, set()).add(item.way)
    whole = {
        body
        for body, seen in ways.items()
        if seen == {*AXES, *TURNS}
        and prepared.free_joint(model, prepared.number(model, "body", body)) >= 0
    }
    if config.settle or not whole:
        return config
    seen = tuple(
        replace(item, floats=item.quantity == "body" and item.part in whole)
        for item in config.seen
    )
    return replace(config, seen=seen)


def place(
    data: mujoco.MjData,
    body: int,
    places: Mapping[str, float],
    speeds: Mapping[str, float] | None = None,
) -> None:
    """Set a free body to where it was, and how fast that changed.

    Args:
        data: of the simulation; written to.
        body: its number.
        places: by `AXES` [m] and `TURNS` [rad]; what is missing stays.
        speeds: of the same, per second; None = they stay.
    """
    joint = prepared.free_joint(data.model, body)
    at, moved = data.model.jnt_qposadr[joint], data.model.jnt_dofadr[joint]
    for number, axis in enumerate(AXES):
        data.qpos[at + number] = places.get(axis, data.qpos[at + number])
    turned = data.qpos[at + 3 : at + 7]
    here = Rotation.from_quat(turned, scalar_first=True).as_euler(ORDER)
    angles = [places.get(way, was) for way, was in zip(TURNS[::-1], here, strict=True)]
    turned[:] = Rotation.from_euler(ORDER, angles).as_quat(scalar_first=True)
    if speeds is not None:
        data.qvel[moved : moved + 3] = [speeds[axis] for axis in AXES]
        rates = [speeds[way] for way in TURNS]
        data.qvel[moved + 3 : moved + 6] = _spin(angles[2], angles[1], rates)


def _spin(roll: float, pitch: float, rates: list[float]) -> np.ndarray:
    """Angular velocity ``(3,)`` [rad/s] about the body's own axes, of the rates of its
    roll, pitch and yaw (Diebel, 2006, eq. 67)."""
    over = np.array(
        [
            [1.0, 0.0, -np.sin(pitch)],
            [0.0, np.cos(roll), np.sin(roll) * np.cos(pitch)],
            [0.0, -np.sin(roll), np.cos(roll) * np.cos(pitch)],
        ]
    )
    made: np.ndarray = over @ rates
    return made
