"""The Khepera III's ASCII protocol: lines out, lines and one binary frame in.

A command is a capital letter and comma-separated arguments, ended by LF; the answer
starts with the same letter in lower case. Numbers wider than 8 bits carry a letter in
front (`d` 16 bit, `l` 32 bit): the robot blanks the first character of each such
argument whatever it is, so a number without its letter loses its first digit
(Khepera III manual 2.2, p. 33 and K-Team's server for the KoreBot).
"""

import re
import struct
from typing import NamedTuple

from bns.errors import OutOfBoundsError

BAUD = 115200
WIDEST = 9_999_999  # the robot's argument buffer holds nine characters
SENSORS = 11
FRAME = struct.Struct("<c11H11H4iI2s")
STOP = b"D,l0,l0\n"

FIELDS = {"b": 2, "d": 0, "e": 2, "n": 12, "o": 12, "r": 2, "i": 0, "v": 2, "z": 0}
"""answer's letter -> numbers in it"""

_NUMBER = re.compile(r"-?\d{1,10}")


class Reading(NamedTuple):
    """All that one `X` frame holds, in device units.

    Attributes:
        proximity, ambient: 11 values each, 0..4095, in the order of the robot.
        speeds: left and right [speed units].
        positions: left and right [counts].
        stamp: the robot's own time, unit not documented.
    """

    proximity: tuple[int, ...]
    ambient: tuple[int, ...]
    speeds: tuple[int, int]
    positions: tuple[int, int]
    stamp: int


def wide(value: int) -> str:
    """A 32-bit argument.

    Raises:
        OutOfBoundsError: longer than the robot's buffer.
    """
    if not -WIDEST <= value <= WIDEST:
        raise OutOfBoundsError("argument", value, -WIDEST, WIDEST, "1")
    return f"l{int(value)}"


def speeds(left: int, right: int) -> bytes:
    """The command that sets both wheels' speeds [speed units]."""
    return f"D,{wide(left)},{wide(right)}\n".encode()


def numbers(line: bytes, letter: str) -> tuple[int, ...] | None:
    """The numbers of an answer, None if it is not the answer to `letter`.

    The letter, the count of numbers and every character are checked: with bytes lost
    on the line, an answer may look almost right. `O` is answered with `n` by some.

    Args:
        line: without its ending.
        letter: of the command, in lower case.
    """
    try:
        text = line.decode("ascii")
    except UnicodeDecodeError:
        return None
    head, *items = text.split(",")
    if head != letter and not (letter == "o" and head == "n"):
        return None
    if len(items) != FIELDS[letter] or not all(map(_NUMBER.fullmatch, items)):
        return None
    return tuple(map(int, items))


def decimal(line: bytes) -> float | None:
    """The value of an answer to `V`: `v,7,9` is 7.9, `v,1350` is 1350."""
    match = re.fullmatch(rb"v,(-?\d{1,6})(?:,(\d{1,3}))?", line)
    if match is None:
        return None
    whole, part = match.groups()
    return float(whole + (b"." + part if part else b""))


def frame(data: bytes) -> Reading | None:
    """The content of an `X` frame, None if it is not one.

    Args:
        data: exactly `FRAME.size` bytes; they end with LF CR, not CR LF.
    """
    if len(data) != FRAME.size:
        return None
    letter, *values, end = FRAME.unpack(data)
    if letter != b"x" or end != b"\n\r":
        return None
    if max(values[: 2 * SENSORS]) > 4095:  # 12 bits
        return None
    return Reading(
        proximity=tuple(values[:SENSORS]),
        ambient=tuple(values[SENSORS : 2 * SENSORS]),
        speeds=(values[22], values[23]),
        positions=(values[24], values[25]),
        stamp=values[26],
    )


def longer(command: bytes) -> float:
    """By how much a command is longer on the wire than the answer `d` [s]."""
    return (len(command) - len(b"d\r\n")) * 10 / BAUD


def ending(buffer: bytes) -> int:
    """Where the first line ends (LF or CR), -1 if none does."""
    found = [at for at in (buffer.find(b"\n"), buffer.find(b"\r")) if at >= 0]
    return min(found) if found else -1
