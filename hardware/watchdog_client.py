"""This process's side of the watchdog: start it, feed it, hear that it has fired."""

import contextlib
import os
import select
import subprocess
import sys
import threading

from bns.errors import BnsError
from bns.hardware.errors import SafetyStop

SILENCE = 0.3  # s without food while the robot moves, after which it is stopped
START = 10.0  # s for the watchdog to be ready
PATIENCE = 60.0  # s for which it goes on trying to stop a robot on a dead line


class WatchdogClient:
    """A watchdog process behind a robot; see `bns.hardware.watchdog`.

    Args:
        fd: open file of the robot's port.
        port: the device.
        baud: bits per second.
        kind: of robot, "khepera3" or "phantomx".
        silence: see `SILENCE` [s].
        patience: see `PATIENCE` [s].

    Raises:
        BnsError: the watchdog does not start. Nothing has moved.

    Attributes:
        heard: what it said, line by line.
    """

    def __init__(
        self,
        fd: int,
        port: str,
        baud: int,
        kind: str,
        *,
        silence: float = SILENCE,
        patience: float = PATIENCE,
    ):
        self.heard: list[str] = []
        self._lock = threading.Lock()
        command = [sys.executable, "-m", "bns.hardware.watchdog"]
        command += ["--fd", str(fd), "--port", port, "--baud", str(baud)]
        command += ["--stop", kind, "--silence", str(silence)]
        command += ["--patience", str(patience)]
        self._dog = subprocess.Popen(
            command,
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            pass_fds=(fd,),
            start_new_session=True,
            bufsize=0,
        )
        if not self._listen(START) or "ready" not in self.heard[-1]:
            self._dog.kill()
            raise BnsError("The watchdog does not start; nothing was moved.")

    @property
    def pid(self) -> int:
        """Of the watchdog."""
        return self._dog.pid

    def feed(self, *, moving: bool) -> None:
        """Say that this process is alive and whether the robot moves.

        Raises:
            SafetyStop: the watchdog has fired, or is gone.
        """
        with self._lock:
            self._listen(0.0)
            fired = [line for line in self.heard if "stopping" in line]
            if fired:
                raise SafetyStop(f"its watchdog fired ({fired[-1].split(' ', 1)[1]})")
            try:
                self._dog.stdin.write(b"m" if moving else b"i")
            except OSError as error:
                raise SafetyStop("its watchdog is gone", "start again") from error

    def forgive(self) -> None:
        """Go on after the watchdog has fired and the robot was looked at."""
        with self._lock:
            self._listen(0.0)
            self.heard.clear()

    def release(self) -> None:
        """End the watchdog; the robot stands."""
        with contextlib.suppress(OSError):
            self._dog.stdin.write(b"q")
            self._dog.stdin.close()
        try:
            self._dog.wait(2.0)
        except subprocess.TimeoutExpired:
            self._dog.kill()
        self._dog.stdout.close()

    def _listen(self, seconds: float) -> bool:
        """Take what it has said; whether it said something."""
        said = False
        out = self._dog.stdout
        while not out.closed and select.select([out], [], [], seconds)[0]:
            data = os.read(out.fileno(), 4096)
            if not data:
                break
            self.heard += data.decode().splitlines()
            said, seconds = True, 0.0
        return said
