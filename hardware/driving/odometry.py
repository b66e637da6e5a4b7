"""Wheel odometry: what encoders and tracker together say of wheels and axle."""

from collections.abc import Iterator, Sequence
from dataclasses import asdict, dataclass
from pathlib import Path
from typing import Literal

import msgspec
import numpy as np

from bns.errors import BnsError, FormatError
from bns.hardware.driving import homing
from bns.hardware.driving.motion import Mover, Point
from bns.models.khepera3 import WHEEL_DIAMETER
from bns.storage import files, reading, seal
from bns.storage.reading import Least, Positive
from bns.worlds.trial import body_displacements

NOMINAL_AXLE = 0.0884  # m (khepera3toolbox, Sim.I.am)
WAY, TURN = 5e-4, 2e-3  # m, rad: what the tracker may be off in a drive; assumed
OFF = 0.10  # share by which a wheel or the axle may differ from nominal
DRIVES = (
    (0.08, 0.08, 4.0), (-0.08, -0.08, 4.0), (0.04, -0.04, 5.0), (-0.04, 0.04, 5.0),
    (0.10, 0.06, 3.5), (-0.10, -0.06, 3.5), (0.06, 0.10, 3.5), (-0.06, -0.10, 3.5),
)  # fmt: skip
"""left, right [m/s], duration [s]: each is undone by the next, within 0.4 m"""


@dataclass(frozen=True, kw_only=True)
class Wheels:
    """Sizes of wheels and axle.

    Attributes:
        left, right: diameters [m].
        axle: distance of the wheels [m].
        error: standard errors of the three [m].
    """

    left: float
    right: float
    axle: float
    error: tuple[float, float, float] = (0.0, 0.0, 0.0)

    @property
    def factors(self) -> tuple[float, float]:
        """Left and right diameter as shares of nominal."""
        return self.left / WHEEL_DIAMETER, self.right / WHEEL_DIAMETER

    def write(self, path: Path | str) -> None:
        """Save as JSON."""
        files.write_json(path, {"format": "bns-wheels", **asdict(self)})

    @classmethod
    def read(cls, path: Path | str) -> "Wheels":
        """The sizes saved in a file.

        Raises:
            FormatError: there is none, or it is something else.
        """
        todo = "Make one with `bns hardware calibrate --what wheels --move`."
        content = seal.opened(reading.read_json(path), path)
        held = reading.typed(content, Sizes, path, todo=todo)
        made = cls(left=held.left, right=held.right, axle=held.axle, error=held.error)
        for factor in (*made.factors, made.axle / NOMINAL_AXLE):
            if not 1 - OFF <= factor <= 1 + OFF:
                raise FormatError(
                    f"{path}: a wheel or the axle is {factor:.2f} times its nominal "
                    "size; measure again."
                )
        return made


class Sizes(msgspec.Struct, forbid_unknown_fields=True):
    """The file of wheels [m], see `Wheels`."""

    format: Literal["bns-wheels"]
    left: Positive
    right: Positive
    axle: Positive
    error: tuple[Least, Least, Least]


def fit(ways: np.ndarray, moved: np.ndarray) -> Wheels:
    """Sizes from drives; least squares of ways and turns together.

    With the encoders' ways l and r at nominal wheels, way = (kl l + kr r) / 2 and
    turn = (kr r - kl l) / axle.

    Args:
        ways: of the left and right wheel, by the encoders, ``(N, 2)`` [m].
        moved: forward, left, turn in the body's frame at its start, ``(N, 3)``
            [m, m, rad].

    Raises:
        BnsError: too few drives, or they do not fit a robot on two wheels.
    """
    from scipy.optimize import least_squares

    if len(ways) < 4:
        raise BnsError(f"{len(ways)} drives are too few: four at least are needed.")
    turn = moved[:, 2]
    ahead = np.cos(turn / 2) * moved[:, 0] + np.sin(turn / 2) * moved[:, 1]
    way = ahead / np.sinc(turn / (2 * np.pi))

    def rest(sizes: np.ndarray) -> np.ndarray:
        left, right, axle = sizes
        by_way = (left * ways[:, 0] + right * ways[:, 1]) / 2 - way
        by_turn = (right * ways[:, 1] - left * ways[:, 0]) / axle - turn
        return np.concatenate([by_way / WAY, by_turn / TURN])

    found = least_squares(rest, [1.0, 1.0, NOMINAL_AXLE], x_scale=[1, 1, 0.1])
    left, right, axle = (float(v) for v in found.x)
    spare = 2 * len(ways) - 3
    spread = np.linalg.pinv(found.jac.T @ found.jac) * 2 * found.cost / spare
    error = np.sqrt(np.diag(spread)) * (WHEEL_DIAMETER, WHEEL_DIAMETER, 1.0)
    made = Wheels(
        left=left * WHEEL_DIAMETER,
        right=right * WHEEL_DIAMETER,
        axle=axle,
        error=(
            round(float(error[0]), 7),
            round(float(error[1]), 7),
            round(float(error[2]), 7),
        ),
    )
    off = max(abs(f - 1) for f in (*made.factors, made.axle / NOMINAL_AXLE))
    if not off <= OFF:
        raise BnsError(
            f"Wheels and axle would be {off:.0%} off nominal: check the camera's "
            "calibration, that the tag's edge is ahead, and that no wheel slips."
        )
    return made


def drives(mover: Mover, start: Sequence[float]) -> Iterator[tuple]:
    """Drive, and give encoders' ways ``(2,)`` and motion ``(3,)`` of each drive.

    Args:
        mover: of the robot.
        start: pose where it begins [m, m, rad].

    Raises:
        SafetyStop: it was stopped.
        Void: a drive was disturbed.
    """
    homing.go(mover, start)
    for left, right, duration in DRIVES:
        before, counts = homing.settled(mover), mover.robot.positions()
        mover.perform([Point(0.0, left, right, 0)], duration)
        after, now = homing.settled(mover), mover.robot.positions()
        ways = [
            mover.robot.units.distance(b - a) for a, b in zip(counts, now, strict=True)
        ]
        yield np.array(ways), body_displacements(np.stack([before.pose, after.pose]))[0]
