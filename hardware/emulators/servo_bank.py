"""Eighteen emulated AX-12A: their packets and their tables, and what they move.

Behind them is a body in MuJoCo or, without one, each servo moves to its goal by itself,
at most at its speed, with a lag. What bites between packets and table follows the
e-manual.
"""

from collections import deque
from collections.abc import Sequence

import numpy as np

from bns.hardware.dynamixel import packets
from bns.hardware.emulators.device import Reply
from bns.hardware.emulators.hexapod_body import HexapodBody

TOP = 6.18 * packets.UNITS  # units/s: 59 rpm without load (e-manual)
TORQUE_OFF = bytes((packets.TORQUE, 0))
LAG = 0.05  # s (assumed)
BYTE = 10 / packets.BAUD  # s


class ServoBank:
    """Servos on an emulated bus.

    Args:
        numbers: of the servos; one given twice answers twice.
        delay: return delay [s] (250 x 2 us from the factory).
        voltage: of the bus [V].
        upset: probability that a status carries a random error bit.
        rng: for that.
        at: time of the start [s].
        body: what they move; None = each its own horn.

    Attributes:
        goals: times of every sync write, newest last.
        stops: when torque was switched off by broadcast [s], the newest last.
    """

    def __init__(
        self,
        numbers: Sequence[int] = range(1, 19),
        *,
        delay: float = 0.0005,
        voltage: float = 11.1,
        upset: float = 0.0,
        rng: np.random.Generator | None = None,
        at: float = 0.0,
        body: HexapodBody | None = None,
    ):
        self.body = body
        self.numbers, self.delay, self.upset = list(numbers), delay, upset
        self.rng = rng or np.random.default_rng(0)
        self.tables = {number: _table(number, voltage) for number in set(numbers)}
        self.place = dict.fromkeys(self.tables, 512.0)
        self.goals: list[float] = []
        self.stops: deque[float] = deque(maxlen=10_000)
        self._voltage = voltage
        self._now, self._buffer = at, b""

    def advance(self, now: float) -> None:
        """Let all servos move until `now` [s]."""
        dt = max(now - self._now, 0.0)
        self._now = now
        if self.body is not None:
            self.body.advance(now)
            return
        for number, table in self.tables.items():
            if not table[packets.TORQUE]:
                continue
            goal = table[packets.GOAL] | table[packets.GOAL + 1] << 8
            asked = table[packets.SPEED] | table[packets.SPEED + 1] << 8
            top = (
                TOP
                if asked == 0
                else min(asked * packets.SPEED_UNIT * packets.UNITS, TOP)
            )
            gap = (goal - self.place[number]) * (1 - np.exp(-dt / LAG))
            self.place[number] += float(np.clip(gap, -top * dt, top * dt))

    def restart(self, now: float, *, power: bool) -> None:
        """All tables as after switching on: no torque, as fast as they can."""
        del power
        self.advance(now)
        self._buffer = b""
        for number in self.tables:
            self.tables[number] = _table(number, self._voltage)
            if self.body is not None:
                self.body.power(number, False)
                self.body.speed(number, 0.0)

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """Take bytes; gives the status packets."""
        self.advance(now)
        found, self._buffer = packets.instructions(self._buffer + data)
        at = now + len(data) * BYTE
        return [reply for item in found for reply in self._obey(item, at)]

    def _obey(self, item: packets.Instruction, at: float) -> list[Reply]:
        if item.code == packets.SYNC_WRITE:
            self._sync(item.parameters, at)
            return []
        off = item.code == packets.WRITE and item.parameters[:2] == TORQUE_OFF
        if off and item.servo == packets.BROADCAST:
            self.stops.append(at)
        replies = []
        for number in self.numbers:
            if item.servo not in (number, packets.BROADCAST):
                continue
            error, values = self._one(number, item)
            if item.servo == packets.BROADCAST:
                continue
            if self.rng.random() < self.upset:
                error |= 1 << int(self.rng.integers(7))
            answer = packets.status(number, error, values)
            replies.append(Reply(at + self.delay + len(answer) * BYTE, answer))
        if len(replies) > 1:  # two servos of one number talk at once
            mixed = bytes(
                a & b ^ 0x15
                for a, b in zip(replies[0].data[2:], replies[1].data[2:], strict=True)
            )
            return [Reply(replies[0].at, b"\xff\xff" + mixed)]
        return replies

    def _one(self, number: int, item: packets.Instruction) -> tuple[int, bytes]:
        table, given = self.tables[number], item.parameters
        if item.code == packets.PING:
            return 0, b""
        if item.code == packets.READ and len(given) == 2:
            self._refresh(number)
            return 0, bytes(table[given[0] : given[0] + given[1]])
        if item.code == packets.WRITE and given:
            return self._write(number, given[0], given[1:]), b""
        return 1 << 6, b""

    def _write(self, number: int, at: int, data: bytes) -> int:
        table = self.tables[number]
        if at + len(data) > len(table):
            return 1 << 3
        if at == packets.GOAL and len(data) >= 2 and data[0] | data[1] << 8 > 1023:
            return 1 << 1
        table[at : at + len(data)] = data
        self._tell(number, table)
        return 0

    def _tell(self, number: int, table: bytearray) -> None:
        """Let the body's servo know its registers, where there is a body."""
        if self.body is None:
            return
        speed = table[packets.SPEED] | table[packets.SPEED + 1] << 8
        self.body.speed(number, speed * packets.SPEED_UNIT)
        self.body.tell(number, table[packets.GOAL] | table[packets.GOAL + 1] << 8)
        self.body.power(number, bool(table[packets.TORQUE]))

    def _sync(self, given: bytes, at: float) -> None:
        if len(given) < 2 or given[1] == 0:
            return
        start, size = given[0], given[1] + 1
        for place in range(2, len(given) - size + 1, size):
            number = given[place]
            if number in self.tables:
                self._write(number, start, given[place + 1 : place + size])
        self.goals.append(at)

    def _refresh(self, number: int) -> None:
        table = self.tables[number]
        position, speed, load = round(self.place[number]), 0.0, 0.0
        if self.body is not None:
            position, speed, load = self.body.reading(number)
        pace = _signed(speed / packets.SPEED_UNIT)
        for place, value in enumerate((position, pace, _signed(load * 1023))):
            table[36 + 2 * place : 38 + 2 * place] = value.to_bytes(2, "little")


def _signed(value: float) -> int:
    """A register whose bit 10 is the direction, set clockwise."""
    return min(round(abs(value)), 1023) | (1024 if value < 0 else 0)


def _table(number: int, voltage: float) -> bytearray:
    table = bytearray(50)
    table[0], table[2], table[3], table[4], table[5] = packets.MODEL, 24, number, 1, 250
    table[8:10], table[14:16], table[34:36] = b"\xff\x03", b"\xff\x03", b"\xff\x03"
    table[26] = table[27] = 1
    table[28] = table[29] = 32
    table[30:32] = table[36:38] = b"\x00\x02"
    table[42], table[43], table[48] = round(voltage * 10), 35, 32
    return table
