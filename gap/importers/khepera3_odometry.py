"""Wheel speeds of a Khepera III beside the motion of its laser, interval by interval.

The form of the supplement of Censi, Franchi, Marchionni and Oriolo, "Simultaneous
calibration of odometry and sensor parameters for mobile robots", IEEE TRO 29(2), 2013:
`lstraight.tuple` holds JSON objects one after the other (some lines hold two) with the
interval T [s], the wheels' mean angular speeds phi_l and phi_r [rad/s] and sm, the
motion of the laser over it [m, m, rad] by scan matching; `lstraight_results.json` holds
the published estimate with its covariance.

One trial comes out: the wheel speeds over the floor at the factory's wheel diameter as
commands, and the laser's pose, chained from its motions; only motions over single
intervals mean something, where the laser was in the room is not known. Lone motions
that no wheel speed explains (lost scan matches) are kept, and clipped by who fits.
"""

import json
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import servo
from bns.storage import reading
from bns.worlds.data import dataset_checks as checks
from bns.worlds.trial import Commands, Trial

TUPLES, RESULTS = "lstraight.tuple", "lstraight_results.json"
WHEEL_RADIUS = 0.0205  # [m] factory: diameter 41 mm
AXLE = 0.0884  # [m] factory
PARAMETERS = ("axle", "l_diam", "r_diam", "l_x", "l_y", "l_theta")


@dataclass(frozen=True, eq=False)
class Published:
    """The published estimate.

    Attributes:
        values: axle, left and right wheel diameter [m], place [m, m] and heading [rad]
            of the laser, by name as in `PARAMETERS`.
        deviations: standard deviation of each.
        covariance: shape ``(6, 6)``.
    """

    values: dict[str, float]
    deviations: dict[str, float]
    covariance: np.ndarray


def read(directory: str | Path) -> Trial:
    """All intervals as one trial.

    Raises:
        FormatError: the file is missing, or an object in it is not such an interval.
    """
    file = servo.directory(directory, TUPLES) / TUPLES
    rows = []
    text = reading.read_text(file, most=reading.DATA)
    for number, item in enumerate(objects(text, str(file))):
        try:
            row = [item["T"], item["phi_l"], item["phi_r"], *item["sm"]]
            rows.append([float(value) for value in row])
        except reading.UNREADABLE as error:
            raise FormatError(f"{file}: object {number + 1}: {error!r}.") from None
        if len(rows[-1]) != 6:
            raise FormatError(f"{file}: object {number + 1}: sm needs three numbers.")
    table = np.array(rows).reshape(-1, 6)
    if not len(table) or not (np.isfinite(table).all() and (table[:, 0] > 0).all()):
        raise FormatError(
            f"{file} holds no interval, NaN, or one that is not positive."
        )
    speeds = table[:, 1:3] * WHEEL_RADIUS
    made = Trial(
        commands=Commands(speeds, table[:, 0]),
        times=np.concatenate([[0.0], np.cumsum(table[:, 0])]),
        observed=chained(table[:, 3:]),
        boundaries=np.arange(len(table) + 1),
        robot="khepera3",
        world="recording",
        conditions={
            "wheel_radius": WHEEL_RADIUS,
            "axle": AXLE,
            "tracked": "laser",
            "objects": len(table),
        },
    )
    checks.plausible(made, str(file))
    return made


def published(directory: str | Path) -> Published:
    """The published estimate of a directory.

    Raises:
        FormatError: the file is missing or not as it should be.
    """
    file = servo.directory(directory, RESULTS) / RESULTS
    try:
        content = reading.read_json(file)
        values = {name: float(content[name]) for name in PARAMETERS}
        covariance = np.array(content["covariance"], dtype=float).reshape(6, 6)
    except (ArithmeticError, KeyError, TypeError, ValueError) as error:
        raise FormatError(f"{file} is no published estimate ({error!r}).") from None
    known = (np.abs([*values.values(), *covariance.ravel()]) <= checks.STRONGEST).all()
    if not known or (np.diag(covariance) < 0).any():
        raise FormatError(
            f"{file}: NaN, a number beyond {checks.STRONGEST:g}, or a covariance that "
            "is negative."
        )
    spread = np.sqrt(np.diag(covariance)).tolist()
    return Published(values, dict(zip(PARAMETERS, spread, strict=True)), covariance)


def objects(text: str, where: str) -> Iterator[dict]:
    """JSON objects that follow each other with nothing but blanks between.

    Raises:
        FormatError: something else is between them.
    """
    decoder, at = json.JSONDecoder(), 0
    while True:
        while at < len(text) and text[at].isspace():
            at += 1
        if at == len(text):
            return
        try:
            item, at = decoder.raw_decode(text, at)
        except json.JSONDecodeError as error:
            line = text.count("\n", 0, error.pos) + 1
            raise FormatError(f"{where}, line {line}: {error.msg}.") from None
        except (ValueError, RecursionError) as error:
            raise FormatError(f"{where} cannot be read as JSON: {error}.") from error
        yield item


def chained(motions: np.ndarray) -> np.ndarray:
    """Poses from the origin, ``(K + 1, 3)``, of motions in the body frame."""
    yaw = np.concatenate([[0.0], np.cumsum(motions[:, 2])])
    cos, sin = np.cos(yaw[:-1]), np.sin(yaw[:-1])
    steps = np.stack(
        [
            cos * motions[:, 0] - sin * motions[:, 1],
            sin * motions[:, 0] + cos * motions[:, 1],
        ],
        axis=1,
    )
    places = np.concatenate([np.zeros((1, 2)), np.cumsum(steps, axis=0)])
    return np.concatenate([places, yaw[:, None]], axis=1)
