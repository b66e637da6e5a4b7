"""Columns of an inertial unit: what its gyro reads, and its accelerations."""

import re
from collections.abc import Sequence

from bns.gap.importers.tables import Column
from bns.gap.models.mjcf import matching
from bns.gap.models.mjcf.described import AXES
from bns.gap.models.mjcf.rehearsal import GYRO, Part

GYROS = frozenset(("gyro", "gyros", "gyr", "gyroscope"))
ACCELERATIONS = frozenset(("acc", "accel", "accelerometer", "acceleration"))
TURNING = ("angular", "velocity")
"""words of a rate of turning, as ROS 2 calls it (sensor_msgs/Imu)"""
SHORT = re.compile("(?P<what>[agw])(?P<axis>[xyz])")
"""the last word of "imu_gx", of a rate (g, w) or an acceleration (a)"""
UNIT = frozenset(("imu", "mpu", "ahrs"))
"""words for an inertial unit"""


def rates(
    columns: Sequence[Column], gyros: Sequence[str]
) -> dict[str, tuple[Part, ...]]:
    """Which gyro each column that is called as a rate of turning is of.

    Args:
        columns: of a log.
        gyros: names in the model.

    Returns:
        by column the gyro, about an axis: the one that is called so, or the only one;
        none of a column of an inertial unit that the model lacks.
    """
    found: dict[str, tuple[Part, ...]] = {}
    for column in columns:
        what, axis, stem = _read(column.name)
        if what != "g":
            continue
        called = [name for name in gyros if matching.core(name) == stem]
        called = called or (list(gyros) if len(gyros) == 1 else [])
        found[column.name] = tuple(Part(GYRO, name, axis) for name in called[:1])
    return found


def accelerations(columns: Sequence[Column]) -> list[str]:
    """Columns that are called as accelerations."""
    return [column.name for column in columns if _read(column.name)[0] == "a"]


def _read(name: str) -> tuple[str, str, str]:
    """What a column of an inertial unit is by its name: "g", of its gyro, or "a", an
    acceleration, "" = neither; the axis; and what is left of the name."""
    said = matching.words(matching.unitless(name))
    last = said[-1] if said else ""
    short = SHORT.fullmatch(last)
    if short and set(said) & (UNIT | GYROS | ACCELERATIONS):
        return short["what"].replace("w", "g"), short["axis"], "".join(said[:-1])
    if last not in AXES:
        return "", "", ""
    if set(said) & GYROS or tuple(said[-3:-1]) == TURNING:
        return "g", last, matching.core("_".join(said[:-1]))
    if set(said) & ACCELERATIONS:
        return "a", last, ""
    return "", "", ""
