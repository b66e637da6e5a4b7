"""The watchdog: a process of its own that stops the robot when nobody feeds it.

    python -m bns.hardware.watchdog --fd N --port DEVICE --baud B --stop KIND
        --silence SECONDS --patience SECONDS

It holds the open port (`fd`) as well as the process that drives. Bytes on its standard
input feed it: `m` the robot moves (another byte has to come within the silence), `i` it
stands, `q` all is done. Silence while moving, or the end of the input at any time (the
driving process is gone, however it died), makes it send the stop until the robot has
acknowledged it twice; where the line is dead it opens the port anew, for as long as its
patience lasts. It says what it does in lines on its standard output.

Little but the standard library is imported, and Ctrl-C and hang-ups are ignored, so it
starts fast and outlives the terminal.
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

from bns.hardware.priority import urgent

KINDS = {
    "khepera3": (b"D,l0,l0\n", b"d"),
    # broadcast WRITE, torque enable (24) = 0; servos do not answer a broadcast
    "phantomx": (b"\xff\xff\xfe\x04\x03\x18\x00\xe2", b""),
}
"""kind of robot -> what stops it, and how the acknowledgement begins (empty: none)"""

ANSWER = 0.12  # s to wait for the acknowledgement
SPEEDS = {115200: termios.B115200, 1000000: termios.B1000000, 57600: termios.B57600}


def main(argv: list[str] | None = None) -> int:
    """Watch until the input ends; gives the exit code, 1 where no stop got through."""
    given = _arguments(argv)
    for number in (signal.SIGINT, signal.SIGTERM, signal.SIGHUP):
        signal.signal(number, signal.SIG_IGN)
    urgent()
    dog = Watchdog(given.fd, given.port, given.baud, given.stop, given.patience)
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


class Watchdog:
    """Sends the stop on a port.

    Args:
        fd: open file of the port.
        port: device, to open anew where the line is dead.
        baud: bits per second.
        kind: key of `KINDS`.
        patience: how long to try [s].
    """

    def __init__(self, fd: int, port: str, baud: int, kind: str, patience: float):
        self.fd, self.port, self.baud, self.patience = fd, port, baud, patience
        self.command, self.answer = KINDS[kind]

    def stop(self, why: str) -> bool:
        """Stop the robot; whether the stop got through."""
        begin = time.monotonic()
        _say(f"stopping: {why}")
        done, tries = 0, 0
        while time.monotonic() - begin < self.patience:
            tries += 1
            try:
                done = done + 1 if self._once() else 0
            except OSError:
                done = 0
                self._reopen()
            if done == (2 if self.answer else 3):
                _say(f"stopped after {time.monotonic() - begin:.3f} s, {tries} tries")
                return True
        _say(f"no stop got through in {self.patience:g} s")
        return False

    def _once(self) -> bool:
        if self.fd < 0:
            raise OSError("the port is not there")
        self._drain(0.0)
        if self.answer:
            os.write(self.fd, b"\n")  # ends a line that was cut
            self._drain(0.02)
        os.write(self.fd, self.command)
        if not self.answer:
            time.sleep(0.005)
            return True
        heard, until = b"", time.monotonic() + ANSWER
        while (left := until - time.monotonic()) > 0:
            if not select.select([self.fd], [], [], left)[0]:
                break
            heard += self._read()
            if any(line.strip() == self.answer for line in heard.split(b"\n")[:-1]):
                return True
        return False

    def _drain(self, seconds: float) -> None:
        while select.select([self.fd], [], [], seconds)[0]:
            self._read()

    def _read(self) -> bytes:
        data = os.read(self.fd, 4096)
        if not data:
            raise OSError("the line is dead")
        return data

    def _reopen(self) -> None:
        """Take the port again, once it is there."""
        time.sleep(0.05)
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


def _say(text: str) -> None:
    with contextlib.suppress(OSError):
        os.write(1, f"{time.monotonic():.4f} {text}\n".encode())


def _arguments(argv: list[str] | None) -> argparse.Namespace:
    parser = argparse.ArgumentParser(prog="bns.hardware.watchdog")
    parser.add_argument("--fd", type=int, required=True)
    parser.add_argument("--port", required=True)
    parser.add_argument("--baud", type=int, required=True)
    parser.add_argument("--stop", choices=sorted(KINDS), required=True)
    parser.add_argument("--silence", type=float, default=0.3)
    parser.add_argument("--patience", type=float, default=60.0)
    return parser.parse_args(argv)


if __name__ == "__main__":
    sys.exit(main())
