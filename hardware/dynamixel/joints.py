"""Which servo is which joint, from a robot's file."""

from pathlib import Path
from typing import Annotated, Any, Literal, NamedTuple

import msgspec
import tomli_w

from bns.errors import FormatError
from bns.hardware.dynamixel.packets import UNITS
from bns.storage import files, reading, seal

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


Place = Annotated[int, msgspec.Meta(ge=0, le=1023)]
"""a position of the servo [units]"""


class Entry(msgspec.Struct, forbid_unknown_fields=True):
    """A joint in the file, see `Joint`."""

    id: Annotated[int, msgspec.Meta(ge=0, le=252)]
    sign: Literal[-1, 1]
    zero: Place
    low: Place
    high: Place


class Servos(msgspec.Struct, forbid_unknown_fields=True):
    """The file."""

    joints: dict[str, Any]


def read(path: Path | str = FILE) -> tuple[Joint, ...]:
    """The joints of a robot, in the order of its file.

    Raises:
        FormatError: not such a file, a number twice, an end stop out of range.
    """
    text = seal.opened_text(reading.read_text(path), path, wanted=False)
    todo = f"Compare it with {FILE.name}."
    found = reading.typed(reading.toml(text, path), Servos, path, todo=todo)
    entries = reading.tables(found.joints, Entry, path, todo=todo)
    joints = tuple(
        Joint(name, t.id, t.sign, t.zero, t.low, t.high) for name, t in entries.items()
    )
    numbers = [joint.id for joint in joints]
    for joint in joints:
        if numbers.count(joint.id) > 1:
            raise FormatError(f"{path}: servo {joint.id} is given twice.")
        if not joint.low < joint.high:
            raise FormatError(f"{path}: {joint.name} needs low < high.")
    return joints


def write(path: Path | str, joints: tuple[Joint, ...], *, said: str) -> None:
    """Write a robot's file.

    Args:
        path: of the file.
        joints: in the order of the file.
        said: a line on where the numbers come from.
    """
    table = {joint.name: joint._asdict() for joint in joints}
    for entry in table.values():
        del entry["name"]
    text = f"# {said}\n{tomli_w.dumps({'joints': table})}"
    files.write_text(path, seal.sealed_text(text))
