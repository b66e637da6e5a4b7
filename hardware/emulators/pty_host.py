"""An emulated device on a pseudo terminal, in real time, and what may happen to it.

A mishap is told to the robot by name while it drives: beside its port lies a named
pipe (`PORT.mishaps`) that takes a word a line, for instance
`echo flood > bns-robot.mishaps`; the same word again ends it. Two have signals as well.
"""

import contextlib
import heapq
import os
import pty
import select
import signal
import termios
import time
import tty
from collections.abc import Callable
from pathlib import Path
from types import FrameType
from typing import Protocol

import numpy as np

from bns.errors import BnsError
from bns.hardware.emulators.camera import PoseServer
from bns.hardware.emulators.device import Device

GARBAGE = np.random.default_rng(0).bytes(4096)
IDLE = 0.004  # s; the loop wakes at least that often

RATES = {getattr(termios, name): int(name[1:]) for name in dir(termios)
         if name[0] == "B" and name[1:].isdigit()}  # fmt: skip


class PtyHost:
    """Serves a device on a pseudo terminal.

    Args:
        device: what is behind it.
        link: path of a symbolic link to the terminal's device; it stays the same
            when the robot is unplugged and plugged in again.
        baud: of the device; a host at another rate sees garbage. 0 = any.

    Attributes:
        late: longest time by which the loop woke too late [s].
        flooded: whether garbage comes at the line's full rate.
        deaf_until: until then nothing is heard or answered [s].
    """

    def __init__(self, device: Device, link: Path | str, *, baud: int = 0):
        self.device, self.link, self.baud = device, Path(link), baud
        self.late = 0.0
        self.flooded, self._flooded_to = False, 0.0
        self.deaf_until = 0.0
        self._master = self._slave = -1
        self._due: list[tuple[float, int, bytes]] = []
        self._count = 0
        self.plug()

    @property
    def plugged(self) -> bool:
        """Whether the cable is in."""
        return self._master >= 0

    def plug(self) -> None:
        """Open the terminal and point the link to it.

        Raises:
            BnsError: the link's path is taken by something else.
        """
        if self._master >= 0:
            return
        self._master, self._slave = pty.openpty()
        tty.setraw(self._slave)  # and kept open: else reads fail until a host comes
        os.set_blocking(self._master, False)
        beside = self.link.with_name(self.link.name + ".part")
        try:
            if self.link.exists() and not self.link.is_symlink():
                raise BnsError(f"{self.link} exists and is no link; take another path.")
            beside.unlink(missing_ok=True)
            beside.symlink_to(os.ttyname(self._slave))
            beside.replace(self.link)
        except OSError as error:
            raise BnsError(f"{self.link} cannot be made: {error.strerror}.") from error

    def unplug(self) -> None:
        """Close the terminal, as when the cable is pulled."""
        for number in (self._master, self._slave):
            with contextlib.suppress(OSError):
                os.close(number)
        self._master = self._slave = -1
        self._due.clear()
        with contextlib.suppress(OSError):
            self.link.unlink()

    def serve(self, stop: Callable[[], bool], *extra: Callable[[float], None]) -> None:
        """Run in real time until `stop` says so.

        Args:
            stop: asked in every round.
            extra: further things to do in every round, given the time [s].
        """
        while not stop():
            now = time.monotonic()
            wait = IDLE
            if self._due:
                wait = min(max(self._due[0][0] - now, 0.0), IDLE)
            if self._master >= 0:
                ready, _, _ = select.select([self._master], [], [], wait)
            else:
                ready = []
                time.sleep(wait)
            woke = time.monotonic()
            self.late = max(self.late, woke - now - wait)
            self.device.advance(woke)
            if ready:
                self._take(woke)
            self._send()
            if self.flooded:
                self._flood(woke)
            for each in extra:
                each(woke)

    def _take(self, now: float) -> None:
        try:
            data = os.read(self._master, 4096)
        except OSError:
            return
        if now < self.deaf_until:
            self._due.clear()
            return
        if self._deaf():
            data = bytes((c * 7 + 0x83) & 0xFF | 0x80 for c in data)  # another rate
        for reply in self.device.receive(data, now):
            self._count += 1
            heapq.heappush(self._due, (reply.at, self._count, reply.data))

    def _flood(self, now: float) -> None:
        """Garbage for the time since the last round."""
        share = min(now - self._flooded_to, 0.02)
        self._flooded_to = now
        noise = GARBAGE[: round(share * (self.baud or 115200) / 10)]
        with contextlib.suppress(OSError):
            os.write(self._master, noise)

    def _deaf(self) -> bool:
        if not self.baud:
            return False
        rate = RATES.get(termios.tcgetattr(self._slave)[4], 0)
        return rate not in (0, 38400, self.baud)  # 38400: nobody has set it yet

    def _send(self) -> None:
        while self._due and self._due[0][0] <= time.monotonic():
            data = heapq.heappop(self._due)[2]
            with contextlib.suppress(OSError):  # nobody reads: the wire does not wait
                os.write(self._master, data)


SUFFIX = ".mishaps"
BOOT = 0.5  # s from power to the first command that is heard (assumed)
WORDS = {
    "cable": "the cable is out",
    "covered": "no picture shows the robot",
    "frozen": "the camera gives the same picture again, with fresh time stamps",
    "stuck": "pictures are new, the robot in them stays where it was",
    "stale": "time stamps stand still",
    "flood": "the line carries garbage at its full rate",
    "reset": "the electronics start anew, deaf for `BOOT`; wheels turn on",
    "power": "no power: nothing turns, holds or answers, `BOOT` longer than that",
}


class Restarts(Protocol):
    """Electronics that may be reset."""

    def restart(self, now: float, *, power: bool) -> None:
        """Forget everything; without power nothing moves or holds either."""
        ...


class Mishaps:
    """Which mishaps are going on.

    Args:
        host: serves the robot's port.
        server: serves its camera.
        robot: its electronics.

    Attributes:
        going: names of those that go on.
        ended: whether the robot was told to end.
        hears: when it hears again after the newest reset [s].
    """

    def __init__(self, host: PtyHost, server: PoseServer, robot: Restarts) -> None:
        self.host, self.server, self.robot = host, server, robot
        self.going: set[str] = set()
        self.ended = False
        self.hears = 0.0
        self._waiting: list[str] = []
        self.path = Path(str(host.link) + SUFFIX)
        with contextlib.suppress(OSError):
            self.path.unlink()
        try:
            os.mkfifo(self.path)
            self._pipe = os.open(self.path, os.O_RDWR | os.O_NONBLOCK)
        except OSError as error:
            raise BnsError(f"{self.path} cannot be made: {error.strerror}.") from error

    def listen(self) -> None:
        """Take the signals of this process."""
        for number in (signal.SIGINT, signal.SIGTERM):
            signal.signal(number, self._end)
        signal.signal(signal.SIGUSR1, self._signal)
        signal.signal(signal.SIGUSR2, self._signal)

    def _end(self, number: int, frame: FrameType | None) -> None:
        self.ended = True

    def _signal(self, number: int, frame: FrameType | None) -> None:
        self._waiting.append("cable" if number == signal.SIGUSR1 else "covered")

    def apply(self, now: float) -> None:
        """Begin and end what was asked for; called in the robot's loop."""
        with contextlib.suppress(BlockingIOError):
            words = os.read(self._pipe, 4096).decode("ascii", "replace").split()
            self._waiting += [word for word in words if word in WORDS]
        waiting, self._waiting = self._waiting, []
        for word in waiting:
            self.going ^= {word}
            self._begin_or_end(word, now)

    def _begin_or_end(self, word: str, now: float) -> None:
        on = word in self.going
        if word == "cable" and on:
            self.host.unplug()
        elif word == "cable":
            self.host.plug()
        elif word == "flood":
            self.host.flooded = on
        elif word in ("reset", "power"):
            self.robot.restart(now, power=word == "reset" or not on)
            lasting = word == "power" and on
            self.hears = float("inf") if lasting else now + BOOT
            self.host.deaf_until = self.hears
            self.going.discard("reset")
        else:
            self.server.mode = word if on else ""

    def close(self) -> None:
        """Take the pipe away."""
        os.close(self._pipe)
        with contextlib.suppress(OSError):
            self.path.unlink()
