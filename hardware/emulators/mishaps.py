"""What may happen to an emulated robot while it drives, told to it by name.

Beside its port lies a named pipe (`PORT.mishaps`) that takes a word a line, for
instance `echo flood > bns-robot.mishaps`; the same word again ends it. Two have signals
as well.
"""

import contextlib
import os
import signal
from pathlib import Path
from types import FrameType
from typing import Protocol

from bns.errors import BnsError
from bns.hardware.emulators.camera import PoseServer
from bns.hardware.emulators.pty_host import PtyHost

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
