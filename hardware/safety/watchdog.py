"""The watchdog: a process of its own that stops the robot when nobody feeds it.

    python -m bns.hardware.safety.watchdog --fd N --port DEVICE --baud B --stop KIND
        --silence SECONDS --patience SECONDS

It holds the open port (`fd`) as well as the process that drives. Bytes on its standard
input feed it: `m` the robot moves (another byte has to come within the silence), `i` it
stands, `q` all is done. Each time it is fed it answers with the line `BEAT`, by which
the driving process knows that it is watched. Silence while moving, or the end of the
input at any time (the driving process is gone, however it died), makes it send the stop
order until the robot has acknowledged it, see `bns.hardware.safety.stop_order`; where
the line is dead it opens the port anew, for as long as its patience lasts. It says what
it does in lines on its standard output.

Little but the standard library is imported, and Ctrl-C and hang-ups are ignored, so it
starts fast and outlives the terminal. All times are monotonic.
"""

import argparse
import contextlib
import os
import select
import signal
import sys
import termios
import time
import tty

from bns.hardware.clock import urgent
from bns.hardware.safety.stop_order import KINDS, StopOrder, insist, order_for

BEAT = "."
SPEEDS = {115200: termios.B115200, 1000000: termios.B1000000, 57600: termios.B57600}
LARGEST = 4096  # bytes read at once


def main(argv: list[str] | None = None) -> int:
    """Watch until the input ends; gives the exit code, 1 where no stop got through."""
    given = _arguments(argv)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    urgent()
    os.set_blocking(given.fd, False)
    os.set_blocking(1, False)
    order = order_for(given.stop, given.servo)
    dog = Watchdog(given.fd, given.port, given.baud, order, given.patience)
    _say("ready")
    moving = False
    while True:
        waiting = given.silence if moving else None
        ready, _, _ = select.select([0], [], [], waiting)
        data = os.read(0, 256) if ready else b""
        if ready and not data:
            return 0 if dog.stop("the driving process is gone") else 1
        if not ready:
            dog.stop("the driving process is silent")
            moving = False
            continue
        if b"q" in data:
            return 0
        moving = data[-1:] == b"m"
        _write(f"{BEAT}\n")


class Watchdog:
    """Sends the stop on a port.

    Args:
        fd: open file of the port, not blocking.
        port: device, to open anew where the line is dead.
        baud: bits per second.
        order: that stops the robot.
        patience: how long to try [s].
    """

    def __init__(
        self, fd: int, port: str, baud: int, order: StopOrder, patience: float
    ) -> None:
        self.fd, self.port, self.baud = fd, port, baud
        self.order, self.patience = order, patience
        self._tries = 0

    def stop(self, why: str) -> bool:
        """Stop the robot; whether it has acknowledged the order."""
        begin, self._tries = time.monotonic(), 0
        self._try_to_write()  # before a word is said
        _say(f"stopping: {why}")
        while (left := begin + self.patience - time.monotonic()) > 0:
            try:
                if insist(
                    self.order, self._write, self._read, time.monotonic, patience=left
                ):
                    took = time.monotonic() - begin
                    _say(f"stopped after {took:.3f} s, {self._tries} tries")
                    return True
            except (OSError, termios.error):
                self._reopen()
        _say(f"no stop was acknowledged in {self.patience:g} s")
        return False

    def _try_to_write(self) -> None:
        with contextlib.suppress(OSError, termios.error):
            self._write(self.order.command)

    def _write(self, data: bytes) -> None:
        self._tries += 1
        send(self.fd, data)

    def _read(self, seconds: float) -> bytes:
        return receive(self.fd, seconds)

    def _reopen(self) -> None:
        """Take the port again, once it is there."""
        time.sleep(0.02)
        if self.fd >= 0:
            with contextlib.suppress(OSError):
                os.close(self.fd)
        self.fd = -1
        try:
            self.fd = os.open(self.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
            tty.setraw(self.fd)
            settings = termios.tcgetattr(self.fd)
            settings[4] = settings[5] = SPEEDS.get(self.baud, termios.B115200)
            termios.tcsetattr(self.fd, termios.TCSANOW, settings)
            _say("the port is back")
        except (OSError, termios.error):
            if self.fd >= 0:
                os.close(self.fd)
            self.fd = -1


def send(fd: int, data: bytes) -> None:
    """Write to a port at once, before what may still wait there to be sent.

    Args:
        fd: open file of the port.
        data: a few bytes.

    Raises:
        OSError: the line is dead.
    """
    if fd < 0:
        raise OSError("the port is not there")
    if not select.select([], [fd], [], 0.0)[1]:
        termios.tcflush(fd, termios.TCOFLUSH)
    with contextlib.suppress(BlockingIOError):  # written again in a moment
        os.write(fd, data)


def receive(fd: int, seconds: float, most: int = LARGEST) -> bytes:
    """What has arrived at a port, within some time; nothing where another read it.

    Args:
        fd: open file of the port, not blocking.
        seconds: to wait for the first byte [s].
        most: bytes.

    Raises:
        OSError: the line is dead.
    """
    if not select.select([fd], [], [], seconds)[0]:
        return b""
    with contextlib.suppress(BlockingIOError):
        data = os.read(fd, most)
        if not data and _hung_up(fd):
            raise OSError("the line is dead")
        return data
    return b""


def _hung_up(fd: int) -> bool:
    """Whether a port that gives no byte has gone, and not only its bytes."""
    asked = select.poll()
    asked.register(fd, select.POLLIN)
    gone = select.POLLHUP | select.POLLERR | select.POLLNVAL
    return any(events & gone for _, events in asked.poll(0))


def _say(text: str) -> None:
    _write(f"{time.monotonic():.4f} {text}\n")


def _write(text: str) -> None:
    with contextlib.suppress(OSError):
        os.write(1, text.encode())


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bns.hardware.safety.watchdog")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--port", required=True)
    parser.add_argument("--baud", type=int, required=True)
    parser.add_argument("--stop", choices=KINDS, required=True)
    parser.add_argument("--servo", type=int, default=1)
    parser.add_argument("--silence", type=float, required=True)
    parser.add_argument("--patience", type=float, default=60.0)
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
