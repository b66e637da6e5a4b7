"""Which servo is which joint, from a robot's file."""

import tomllib
from pathlib import Path
from typing import NamedTuple

from bns.errors import FormatError
from bns.hardware.dynamixel.packets import UNITS

FILE = Path(__file__).with_name("phantomx.toml")


class Joint(NamedTuple):
    """A servo.

    Attributes:
        name: of the joint.
        id: on the bus.
        sign: 1, or -1 where the servo turns the other way.
        zero: position at the angle 0 [units].
        low, high: end stops [units].
    """

    name: str
    id: int
    sign: int
    zero: int
    low: int
    high: int

    def units(self, angle: float) -> int:
        """The goal position of an angle [rad], kept between the end stops."""
        wanted = round(self.zero + self.sign * angle * UNITS)
        return min(max(wanted, self.low), self.high)

    def angle(self, units: int) -> float:
        """The angle [rad] of a position."""
        return self.sign * (units - self.zero) / UNITS


def read(path: Path | str = FILE) -> tuple[Joint, ...]:
    """The joints of a robot, in the order of its file.

    Raises:
        FormatError: not such a file, a number twice, an end stop out of range.
    """
    try:
        table = tomllib.loads(Path(path).read_text(encoding="utf-8"))["joints"]
        joints = tuple(Joint(name, **entry) for name, entry in table.items())
    except (OSError, tomllib.TOMLDecodeError, KeyError, TypeError) as error:
        raise FormatError(
            f"{path} does not say which servo is which ({error}): compare it with "
            f"{FILE.name}."
        ) from error
    numbers = [joint.id for joint in joints]
    for joint in joints:
        if numbers.count(joint.id) > 1:
            raise FormatError(f"{path}: servo {joint.id} is given twice.")
        if not 0 <= joint.low < joint.high <= 1023 or joint.sign not in (-1, 1):
            raise FormatError(
                f"{path}: {joint.name} needs 0 <= low < high <= 1023, sign 1 or -1."
            )
    return joints


def write(path: Path | str, joints: tuple[Joint, ...], *, said: str) -> None:
    """Write a robot's file.

    Args:
        path: of the file.
        joints: in the order of the file.
        said: a line on where the numbers come from.
    """
    rows = [
        f"{joint.name} = {{ id = {joint.id}, sign = {joint.sign}, zero = {joint.zero}, "
        f"low = {joint.low}, high = {joint.high} }}"
        for joint in joints
    ]
    text = "\n".join([f"# {said}", "[joints]", *rows, ""])
    Path(path).write_text(text, encoding="utf-8")
