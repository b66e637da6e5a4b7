"""The stop order of each kind of robot, and how it is insisted on.

One rule for all robots, for the driver and for the watchdog: the order is written
before anything is read or asked, and again every `AGAIN` seconds, until the robot has
acknowledged it often enough. Reading never holds up a write: a line that goes on
talking is read until the next order is due and no longer.

Fragments of a stop order hold nothing but zeros, so that sending one on top of another
does no harm. Nothing but the standard library is imported: the watchdog starts fast.
"""

import re
from collections.abc import Callable
from typing import NamedTuple

AGAIN = 0.04  # s after which an order that was not acknowledged is written again
KEPT = 64  # bytes of unread answers that are kept: longer than any acknowledgement


class StopOrder(NamedTuple):
    """What stops a robot.

    Attributes:
        command: bytes to write.
        answer: what an acknowledgement looks like.
        acknowledged: acknowledgements that make sure of it. A Khepera also sends one
            for the command before the order, and has to be told twice, as a number
            that loses its comma leaves the other wheel as it was.
    """

    command: bytes
    answer: "re.Pattern[bytes]"
    acknowledged: int


def khepera3() -> StopOrder:
    """Both wheels' speeds set to 0, answered by `d`."""
    return StopOrder(b"D,l0,l0\n", re.compile(rb"(?:^|(?<=[\r\n]))d\r?\n"), 3)


def phantomx(servo: int = 1) -> StopOrder:
    """Torque off by broadcast, then a question after the torque of one servo.

    Nothing answers a broadcast; the status of the servo that is asked acknowledges it.

    Args:
        servo: number of the servo that is asked.
    """
    off = _packet(0xFE, 0x03, 0x18, 0x00)  # WRITE torque enable (24) = 0
    ask = _packet(servo, 0x02, 0x18, 0x01)  # READ one byte at 24
    statuses = (_packet(servo, error, 0x00) for error in range(0x80))
    answer = re.compile(b"|".join(map(re.escape, statuses)))
    return StopOrder(off + ask, answer, 2)


KINDS = ("khepera3", "phantomx")


def order_for(kind: str, servo: int = 1) -> StopOrder:
    """The stop order of a kind of robot, see `KINDS`.

    Args:
        kind: of robot.
        servo: number of the servo that is asked, where there are servos.
    """
    return khepera3() if kind == "khepera3" else phantomx(servo)


def insist(
    order: StopOrder,
    write: Callable[[bytes], object],
    read: Callable[[float], bytes],
    now: Callable[[], float],
    *,
    patience: float,
    meanwhile: Callable[[], object] = lambda: None,
) -> bool:
    """Write an order until it is acknowledged; whether it was.

    Args:
        order: to write.
        write: sends bytes at once; may raise where the line is dead.
        read: gives what has arrived, within some seconds; may raise as well.
        now: monotonic time [s].
        patience: how long to try [s].
        meanwhile: called in every round, after the order was written.
    """
    begin = due = now()
    heard, count = b"", 0
    while (at := now()) - begin < patience:
        if at >= due:
            write(order.command)
            due = at + AGAIN
        meanwhile()
        heard += read(max(due - now(), 0.0))
        found = list(order.answer.finditer(heard))
        if found:
            heard, due = heard[found[-1].end() :], now()
            count += len(found)
            if count >= order.acknowledged:
                return True
        heard = heard[-KEPT:]
    return False


def _packet(servo: int, *rest: int) -> bytes:
    """A packet of Dynamixel protocol 1.0: instruction or error, then parameters."""
    body = bytes((servo, len(rest) + 1, *rest))
    return b"\xff\xff" + body + bytes((~sum(body) & 0xFF,))
