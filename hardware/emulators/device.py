"""What every emulated device is, and the line that rehearses it in virtual time."""

import heapq
from typing import NamedTuple, Protocol

import numpy as np

from bns.hardware.clock import VirtualClock
from bns.hardware.faults import LinkError


class Reply(NamedTuple):
    """Bytes that a device sends.

    Attributes:
        at: when they are there [s].
        data: the bytes.
    """

    at: float
    data: bytes


class Device(Protocol):
    """An emulated robot's electronics, without a clock or port of its own."""

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """Take bytes from the host; gives what is sent in answer, and when."""
        ...

    def advance(self, now: float) -> None:
        """Let the physics go on until `now` [s]."""
        ...


class Noise:
    """A bad line around a device: bytes get lost, packets get corrupted.

    Args:
        device: behind the line.
        lost: probability that a byte is lost, either way.
        corrupted: probability that one byte of a packet is another one, either way.
        rng: the only source of randomness.

    Attributes:
        counts: bytes lost and packets corrupted so far.
    """

    def __init__(
        self,
        device: Device,
        *,
        lost: float = 0.0,
        corrupted: float = 0.0,
        rng: np.random.Generator,
    ):
        self.device, self.lost, self.corrupted, self.rng = device, lost, corrupted, rng
        self.counts = {"lost": 0, "corrupted": 0}

    def receive(self, data: bytes, now: float) -> list[Reply]:
        """As the device does, over the bad line."""
        replies = self.device.receive(self._spoilt(data), now)
        return [Reply(reply.at, self._spoilt(reply.data)) for reply in replies]

    def advance(self, now: float) -> None:
        """As the device does."""
        self.device.advance(now)

    def _spoilt(self, data: bytes) -> bytes:
        if not data or not (self.lost or self.corrupted):
            return data
        values = np.frombuffer(data, np.uint8).copy()
        if self.rng.random() < self.corrupted:
            at = int(self.rng.integers(len(values)))
            values[at] ^= 1 << int(self.rng.integers(8))
            self.counts["corrupted"] += 1
        keep = self.rng.random(len(values)) >= self.lost
        self.counts["lost"] += int((~keep).sum())
        return values[keep].tobytes()


class VirtualLine:
    """A line to a device in the same process, in virtual time.

    Args:
        device: at its other end.
        clock: advanced while something waits for bytes.

    Attributes:
        plugged: False = the cable is out.
    """

    def __init__(self, device: Device, clock: VirtualClock):
        self.device, self.clock, self.plugged = device, clock, True
        self._due: list[tuple[float, int, bytes]] = []
        self._count = 0

    def write(self, data: bytes) -> None:
        """Send, see `Line.write`."""
        self._check()
        now = self.clock.now()
        self.device.advance(now)
        for reply in self.device.receive(data, now):
            self._count += 1
            heapq.heappush(self._due, (reply.at, self._count, reply.data))

    def order(self, data: bytes) -> None:
        """Send at once, see `Line.order`."""
        self.write(data)

    def read(self, timeout: float) -> bytes:
        """What has arrived, see `Line.read`."""
        self._check()
        now = self.clock.now()
        first = self._due[0][0] if self._due else float("inf")
        if first > now + timeout:
            self.clock.sleep(timeout)
            return b""
        self.clock.sleep(max(first - now, 0.0))
        return self._arrived()

    def discard(self) -> None:
        """Forget what has arrived."""
        self._check()
        self._arrived()

    def intruder(self) -> bool:
        """Nobody else can open it."""
        return False

    def others(self) -> list[str]:
        """Nobody else can open it."""
        return []

    def close(self) -> None:
        """Nothing to give back."""

    def _arrived(self) -> bytes:
        data = b""
        while self._due and self._due[0][0] <= self.clock.now() + 1e-12:
            data += heapq.heappop(self._due)[2]
        return data

    def _check(self) -> None:
        if not self.plugged:
            raise LinkError("The line is dead (unplugged): plug it in.")
