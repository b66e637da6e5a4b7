"""Khepera III: device units of its firmwares, and how the model has to drive.

Both generations of firmware are known. Their conversions differ by a factor of 1.52, so
one that is not known is refused rather than guessed; the robot's answer to `B` tells
it.

The targets of the calibration come from what a simulator network, trained on the
laboratory's robot, answers to a steady command of 17 500 units (firmware < 3).
"""

from dataclasses import dataclass
from math import pi
from typing import Any, NamedTuple

import numpy as np

from bns.errors import UnknownNameError

WHEEL_DIAMETER = 0.041
"""m; nominal (Khepera III manual 2.2, p. 12)"""


@dataclass(frozen=True)
class Firmware:
    """What one generation of the firmware counts in.

    Attributes:
        name: "before-3" or "from-3".
        speed_units: speed units per m/s over the floor.
        counts: encoder counts per turn of a wheel.
        source: of the two.
    """

    name: str
    speed_units: float
    counts: float
    source: str

    def speed(self, units: float) -> float:
        """Speed over the floor [m/s] of a speed in device units."""
        return units / self.speed_units

    def units(self, speed: float) -> float:
        """Device units of a speed over the floor [m/s]; the robot takes whole ones."""
        return speed * self.speed_units

    def angle(self, counts: float) -> float:
        """Angle of a wheel [rad] after so many encoder counts."""
        return counts / self.counts * 2 * pi

    def distance(self, counts: float) -> float:
        """Way over the floor [m] of so many encoder counts, nominal wheel."""
        return self.angle(counts) * WHEEL_DIAMETER / 2

    def encoder(self, distance: float) -> float:
        """Encoder counts of a way over the floor [m], nominal wheel."""
        return distance / (WHEEL_DIAMETER / 2) / (2 * pi) * self.counts


FIRMWARES = {
    "before-3": Firmware(
        "before-3",
        speed_units=144.01e3,
        counts=2764.8,
        source="Khepera III manual 2.2: p. 14 (speed), pp. 12 and 36 (encoder)",
    ),
    "from-3": Firmware(
        "from-3",
        speed_units=218.72e3,
        counts=4198.0,
        source="Sim.I.am, +simiam/+robot/Khepera3.m; one source, not confirmed",
    ),
}


def firmware(version: str | int) -> Firmware:
    """The units of a firmware.

    Args:
        version: "before-3" or "from-3", or the version number that the robot answers
            to `B` (`b,version,revision`).

    Raises:
        UnknownNameError: neither a name nor a positive version number.
    """
    if isinstance(version, int) and not isinstance(version, bool) and version >= 1:
        return FIRMWARES["before-3" if version < 3 else "from-3"]
    if version not in FIRMWARES or isinstance(version, int):
        raise UnknownNameError("Khepera III firmware", str(version), FIRMWARES)
    return FIRMWARES[str(version)]


COMMAND = FIRMWARES["before-3"].speed(17500)
"""m/s; the largest command of the laboratory's controllers, 0.12152 m/s"""

_SETTLE = 0.5  # s at rest before a measurement
_DRIVE = 3.0  # s
_STEADY = 1.0  # s, the end of the drive: its mean is the steady rate


class Calibration(NamedTuple):
    """Four figures of a drive from rest, both wheels at `COMMAND`.

    Attributes:
        speed: steady, both wheels forward [m/s].
        spin: steady turning rate, wheels opposed [rad/s], magnitude.
        lost_distance: way lost by starting from rest instead of at that speed [m].
        lost_angle: angle lost by starting from rest instead of at that rate [rad].
    """

    speed: float
    spin: float
    lost_distance: float
    lost_angle: float


TARGET = Calibration(
    speed=0.1214,
    spin=np.radians(159.3),
    lost_distance=0.0165,
    lost_angle=np.radians(11),
)
TOLERANCE = Calibration(speed=0.03, spin=0.03, lost_distance=0.10, lost_angle=0.10)
"""share of the target that each figure may be off"""


def measure(spec: Any) -> Calibration:
    """The four figures of a robot on a floor.

    Args:
        spec: a `mujoco.MjSpec` of the Khepera III with a floor; stays as it is.
    """
    model = spec.copy().compile()
    ahead = drive(model, COMMAND, COMMAND)
    turn = drive(model, COMMAND, -COMMAND)
    speed, lost_distance = _steady(ahead[:, 0], model.opt.timestep)
    spin, lost_angle = _steady(-turn[:, 2], model.opt.timestep)
    return Calibration(speed, spin, lost_distance, lost_angle)


def deviations(measured: Calibration) -> dict[str, float]:
    """Each figure's deviation from `TARGET`, as a share of what is allowed (<= 1)."""
    rows = zip(Calibration._fields, measured, TARGET, TOLERANCE, strict=True)
    return {
        name: abs(value - target) / (tolerance * target)
        for name, value, target, tolerance in rows
    }


def drive(model: Any, left: float, right: float, seconds: float = _DRIVE) -> Any:
    """Planar poses of the base while the wheels are told constant speeds.

    Args:
        model: a compiled `mujoco.MjModel`.
        left, right: commands [m/s].
        seconds: how long.

    Returns:
        Poses relative to the start, shape ``(S + 1, 3)`` [m, m, rad].
    """
    import mujoco

    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, model.key("home").id)
    for _ in range(round(_SETTLE / model.opt.timestep)):
        mujoco.mj_step(model, data)
    poses = [_pose(data)]
    data.ctrl[:] = np.array([left, right]) / (WHEEL_DIAMETER / 2)
    for _ in range(round(seconds / model.opt.timestep)):
        mujoco.mj_step(model, data)
        poses.append(_pose(data))
    moved = np.array(poses)
    moved[:, 2] = np.unwrap(moved[:, 2])
    return moved - moved[0]


def _pose(data: Any) -> list[float]:
    x, y = data.qpos[:2]
    w, i, j, k = data.qpos[3:7]
    return [x, y, np.arctan2(2 * (w * k + i * j), 1 - 2 * (j * j + k * k))]


def _steady(way: np.ndarray, dt: float) -> tuple[float, float]:
    """Steady rate at the end, and what was lost against it since the start."""
    last = round(_STEADY / dt)
    rate = (way[-1] - way[-1 - last]) / (last * dt)
    return float(rate), float(rate * (len(way) - 1) * dt - way[-1])
