"""The line to a robot: bytes out, bytes in, over a serial port, and who else has it."""

import contextlib
import ctypes
import errno
import os
import struct
from pathlib import Path
from typing import Any, Protocol

from bns.errors import BnsError, MissingDependencyError, install
from bns.hardware.clock import RealClock
from bns.hardware.faults import FaultLog, LinkError
from bns.hardware.safety.watchdog import receive, send


class Line(Protocol):
    """What a driver talks through."""

    def write(self, data: bytes) -> None:
        """Send.

        Raises:
            LinkError: the line is dead.
        """
        ...

    def order(self, data: bytes) -> None:
        """Send at once, before what may still wait to be sent; never waits.

        Raises:
            LinkError: the line is dead.
        """
        ...

    def read(self, timeout: float) -> bytes:
        """What has arrived; waits at most `timeout` [s] for the first byte.

        Raises:
            LinkError: the line is dead.
        """
        ...

    def discard(self) -> None:
        """Forget what has arrived."""
        ...

    def intruder(self) -> bool:
        """Whether another program has opened the line; told once for each."""
        ...

    def others(self) -> list[str]:
        """Programs that have the line open as well, as "name (number)"."""
        ...

    def close(self) -> None:
        """Give the port back."""
        ...


class SerialLine:
    """A serial port, held by this process alone.

    Args:
        port: device file.
        baud: bits per second; 8 data bits, no parity, 1 stop bit.

    Raises:
        MissingDependencyError: pyserial is not installed.
        BnsError: no such port, no permission, in use, not a serial port.
    """

    def __init__(self, port: str, baud: int = 115200):
        self.port, self.baud = port, baud
        serial = pyserial()
        check_port(port)
        try:
            self._serial = serial.Serial(
                port, baud, timeout=0.1, write_timeout=0.05, exclusive=True
            )
            claim(self._serial.fileno())
            self._openers = Openers(port)
        except (OSError, ValueError) as error:  # SerialException is an OSError
            raise _explained(port, error) from error

    def fileno(self) -> int:
        """The open file's number, for the watchdog."""
        return self._serial.fileno()

    def write(self, data: bytes) -> None:
        """Send, see `Line.write`."""
        try:
            self._serial.write(data)
        except OSError as error:
            raise self._dead(error) from error

    def order(self, data: bytes) -> None:
        """Send at once, see `Line.order`."""
        try:
            send(self._serial.fileno(), data)
        except _errors() as error:
            raise self._dead(error) from error

    def read(self, timeout: float) -> bytes:
        """What has arrived, see `Line.read`."""
        try:
            return receive(self._serial.fileno(), max(timeout, 0.0))
        except _errors() as error:
            raise self._dead(error) from error

    def discard(self) -> None:
        """Forget what has arrived."""
        try:
            self._serial.reset_input_buffer()
        except _errors() as error:
            raise self._dead(error) from error

    def intruder(self) -> bool:
        """See `Line.intruder`."""
        return self._openers.intruder()

    def others(self) -> list[str]:
        """See `Line.others`."""
        return self._openers.others()

    def close(self) -> None:
        """Give the port back."""
        self._openers.close()
        self._serial.close()

    def _dead(self, error: BaseException) -> LinkError:
        return LinkError(
            f"The line on {self.port} is dead ({error}): check cable, power and "
            "Bluetooth; a robot that was moving may still be."
        )


def claim(fd: int) -> None:
    """Let no other program open a port that is open here.

    It holds for programs without the administrator's rights, where the device knows of
    it (`TIOCEXCL`); else the lock that well-behaved programs ask for is all there is.

    Args:
        fd: open file of the port.
    """
    import fcntl
    import termios

    with contextlib.suppress(OSError):
        fcntl.ioctl(fd, termios.TIOCEXCL)


def check_port(port: str) -> None:
    """Refuse a port that cannot be one.

    Raises:
        BnsError: it does not exist, may not be opened, or is no device.
    """
    if not port:
        raise BnsError(f"No port was given: give --port DEVICE{_ports()}.")
    if not os.path.exists(port):
        raise BnsError(f"There is no port {port}{_ports()}.")
    if not os.access(port, os.R_OK | os.W_OK):
        raise BnsError(
            f"No permission for {port}: join its group (usermod -aG dialout USER) "
            "and log in again."
        )


def _ports() -> str:
    from glob import glob

    found = sorted(
        port
        for kind in ("ttyUSB", "ttyACM", "rfcomm")
        for port in glob(f"/dev/{kind}*")
    )
    return (
        f"; this machine has {', '.join(found)}"
        if found
        else ("; this machine has none now (rehearse with `bns hardware emulate`)")
    )


def _explained(port: str, error: BaseException) -> BnsError:
    code = getattr(error, "errno", None)
    busy = code in (errno.EBUSY, errno.EAGAIN) or "lock" in str(error)
    if busy:
        return BnsError(
            f"Port {port} is in use by another program: end that one first."
        )
    if code in (errno.ENOTTY, errno.EINVAL) or "configure port" in str(error):
        return BnsError(f"{port} is no serial port: give the robot's device file.")
    return BnsError(f"Port {port} cannot be opened: {error}.")


def pyserial() -> Any:
    """The module of pyserial.

    Raises:
        MissingDependencyError: it is not installed.
    """
    try:
        import serial
    except ImportError as error:
        raise MissingDependencyError(
            "a robot on a port", "pyserial", install("hardware")
        ) from error
    return serial


def _errors() -> tuple[type[BaseException], ...]:
    import termios

    return (OSError, termios.error, TypeError, ValueError)  # the last: closed


MISHAPS = ".mishaps"
"""what the name of the pipe beside an emulated robot's port ends with"""


def ports(place: Path | str = ".") -> dict[str, str]:
    """Ports by device, each with what is known of it.

    Args:
        place: directory in which emulated robots are looked for.

    Raises:
        MissingDependencyError: pyserial is not installed.
    """
    pyserial()
    from serial.tools import list_ports

    found = {item.device: item.description for item in sorted(list_ports.comports())}
    for pipe in sorted(Path(place).glob(f"*{MISHAPS}")):
        link = pipe.with_name(pipe.name.removesuffix(MISHAPS))
        if link.exists():
            found[str(link)] = "an emulated robot"
    return found


def answers(port: str) -> str:
    """Who answers on a port: a line. Nothing moves.

    A Khepera III is asked for its firmware, then the servos of a hexapod whether they
    are there. Another device gets those bytes as well, so ask only where none is that
    could be harmed.
    """
    said = []
    for look in (_khepera3, _phantomx):
        try:
            return look(port)
        except BnsError as error:
            said.append(str(error))
    return said[0]


def _khepera3(port: str) -> str:
    from bns.hardware.khepera import protocol
    from bns.hardware.khepera.driver import Khepera3

    clock = RealClock()
    line = SerialLine(port, protocol.BAUD)
    try:
        robot = Khepera3(line, clock, faults=FaultLog(clock))
        version = robot.identify()
    finally:
        line.close()
    return f"khepera3, firmware {version[0]}.{version[1]}"


def _phantomx(port: str) -> str:
    from bns.hardware.dynamixel import joints
    from bns.hardware.dynamixel.bus import Bus

    bus = Bus(port, joints.read(), RealClock())
    try:
        bus.identify()
    finally:
        bus.release()
    return f"phantomx, {len(bus.joints)} servos"


OPENED = 0x20  # IN_OPEN of inotify(7)
NOT_BLOCKING = os.O_NONBLOCK | os.O_CLOEXEC  # IN_NONBLOCK, IN_CLOEXEC are the same
EVENT = struct.Struct("iIII")  # struct inotify_event, its name left out


class Openers:
    """Notes when somebody opens a port that is open here.

    The kernel tells (inotify), whoever it is; asking costs microseconds. On a system
    that has no such thing nobody is ever seen.

    Args:
        port: device; opened already. Who else holds it by then (the process of an
            emulated robot does) is none of the others.
    """

    def __init__(self, port: str) -> None:
        self._port, self._come = os.path.realpath(port), False
        self._known = _holders(self._port).keys()
        self._events = -1
        with contextlib.suppress(OSError, AttributeError):
            library = ctypes.CDLL(None, use_errno=True)
            self._events = library.inotify_init1(NOT_BLOCKING)
            name = os.fsencode(self._port)
            library.inotify_add_watch(self._events, name, OPENED)

    def intruder(self) -> bool:
        """Whether somebody has opened the port since it was last asked."""
        with contextlib.suppress(OSError):  # BlockingIOError: nobody
            data = os.read(self._events, 4096)
            come = bool(EVENT.unpack_from(data)[1] & OPENED)
            self._come = self._come or come
            return come
        return False

    def others(self) -> list[str]:
        """Programs that have the port open now, as "name (number)".

        Looked for once somebody was seen to open it. Those of other users cannot be
        seen without the administrator's rights.
        """
        self.intruder()
        if not self._come:
            return []
        found = sorted(_holders(self._port).items())
        others = [f"{name} ({pid})" for pid, name in found if pid not in self._known]
        self._come = bool(others)
        return others

    def close(self) -> None:
        """Look no more."""
        with contextlib.suppress(OSError):
            os.close(self._events)
        self._events = -1


def _holders(port: str) -> dict[int, str]:
    """Names of the processes that have a device open, this one and its own left out.

    Args:
        port: device, no link to one.
    """
    found = {}
    for folder in Path("/proc").glob("[0-9]*"):
        with contextlib.suppress(OSError, IndexError):
            if not any(_is(number, port) for number in (folder / "fd").iterdir()):
                continue
            name, rest = (folder / "stat").read_text().split("(", 1)[1].rsplit(")", 1)
            if os.getpid() not in (int(folder.name), int(rest.split()[1])):
                found[int(folder.name)] = name
    return found


def _is(number: Path, port: str) -> bool:
    """Whether an open file of a process is a device."""
    with contextlib.suppress(OSError):
        return os.readlink(number) == port and os.path.samefile(number, port)
    return False
