"""This process's side of the watchdog: start it, feed it, see that it is awake."""

import contextlib
import os
import select
import subprocess
import sys
import time

from bns.errors import BnsError
from bns.hardware.faults import SafetyStop, Void
from bns.hardware.safety.watchdog import BEAT

SILENCE = 0.14  # s without food while the robot moves, after which it is stopped
ASLEEP = 0.10  # s without a beat after food, after which the watchdog counts as asleep
WAKE = 0.5  # s for the answer to the first food; the robot still stands
START = 10.0  # s for the watchdog to be ready
PATIENCE = 60.0  # s for which it goes on trying to stop a robot on a dead line


class WatchdogClient:
    """A watchdog process behind a robot; see `bns.hardware.safety.watchdog`.

    Each watches the other: the watchdog stops the robot where it is not fed, and
    feeding raises where the watchdog does not answer.

    Args:
        fd: open file of the robot's port.
        port: the device.
        baud: bits per second.
        kind: of robot, "khepera3" or "phantomx".
        servo: number of a servo that the watchdog may ask.
        silence: see `SILENCE` [s].
        patience: see `PATIENCE` [s].

    Raises:
        BnsError: the watchdog does not start. Nothing has moved.

    Attributes:
        heard: what it said, line by line, beats left out.
    """

    def __init__(
        self,
        fd: int,
        port: str,
        baud: int,
        kind: str,
        *,
        servo: int = 1,
        silence: float = SILENCE,
        patience: float = PATIENCE,
    ) -> None:
        self.heard: list[str] = []
        self._moving = False  # as last told
        self._asked: float | None = None  # when it was fed and has not answered since
        self._part = b""
        self._reader, out = os.pipe()
        inside, self._writer = os.pipe()
        command = [sys.executable, "-m", "bns.hardware.safety.watchdog"]
        command += ["--fd", str(fd), "--port", port, "--baud", str(baud)]
        command += ["--stop", kind, "--servo", str(servo)]
        command += ["--silence", str(silence), "--patience", str(patience)]
        self._process = subprocess.Popen(
            command,
            stdin=inside,
            stdout=out,
            pass_fds=(fd,),
            start_new_session=True,
        )
        os.close(inside)
        os.close(out)
        os.set_blocking(self._reader, False)
        os.set_blocking(self._writer, False)
        self._listen(START)
        if not any("ready" in line for line in self.heard):
            self._process.kill()
            raise BnsError("The watchdog does not start; nothing was moved.")
        self.heard.clear()

    @property
    def pid(self) -> int:
        """Of the watchdog."""
        return self._process.pid

    def feed(self, *, moving: bool) -> None:
        """Say that this process is alive and whether the robot moves.

        The first food of a robot that begins to move waits for the answer: nothing
        moves without a watchdog that is awake.

        Raises:
            SafetyStop: the watchdog is gone, or does not answer the first food.
            Void: it has fired, or did not answer for a while.
        """
        here = self._listen(0.0)
        first, self._moving = moving and not self._moving, moving
        if not here:
            raise SafetyStop("its watchdog is gone", "start again")
        self._fired()
        if first:
            self._asked = None
        elif self._asked is not None and time.monotonic() - self._asked > ASLEEP:
            raise Void(f"its watchdog did not answer for {ASLEEP:g} s")
        try:
            os.write(self._writer, b"m" if moving else b"i")
        except OSError as error:
            raise SafetyStop("its watchdog is gone", "start again") from error
        if self._asked is None:
            self._asked = time.monotonic()
        if first:
            self._awake()

    def release(self) -> None:
        """Let the watchdog go; where the robot may still move, it stops it first.

        A robot whose stop was not confirmed is left to it: the end of its input is
        the sign, and it goes on trying for as long as its patience lasts.
        """
        if not self._moving:
            with contextlib.suppress(OSError):
                os.write(self._writer, b"q")
        for number in (self._writer, self._reader):
            with contextlib.suppress(OSError):
                os.close(number)
        if self._moving:
            return
        try:
            self._process.wait(2.0)
        except subprocess.TimeoutExpired:
            self._process.kill()

    def _awake(self) -> None:
        """Wait for the answer to the first food."""
        until = time.monotonic() + WAKE
        while self._asked is not None and time.monotonic() < until:
            if not self._listen(until - time.monotonic()):
                break
        if self._asked is not None:
            self._moving = False
            raise SafetyStop("its watchdog does not answer", "start again")

    def _fired(self) -> None:
        fired = [line for line in self.heard if "stopping" in line]
        if fired:
            self.heard.clear()
            reason = fired[-1].split("stopping: ", 1)[1]
            raise Void(f"its watchdog stopped the robot ({reason})")

    def _listen(self, seconds: float) -> bool:
        """Take what it has said; False where it is gone."""
        if not select.select([self._reader], [], [], max(seconds, 0.0))[0]:
            return True
        with contextlib.suppress(BlockingIOError):
            data = os.read(self._reader, 65536)
            if not data:
                return False
            *lines, self._part = (self._part + data).split(b"\n")
            said = [line.decode("ascii", "replace") for line in lines]
            if BEAT in said:
                self._asked = None
            self.heard += [line for line in said if line != BEAT]
        return True
