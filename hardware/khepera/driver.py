"""The driver of a Khepera III: one command, one answer, and nothing moves unwatched."""

import contextlib
from collections.abc import Callable
from typing import Any, NamedTuple, Protocol

from bns.errors import BnsError
from bns.hardware.clock import Clock
from bns.hardware.faults import FaultLog, LinkError, SafetyStop, Void
from bns.hardware.khepera import protocol
from bns.hardware.line import Line
from bns.hardware.safety.stop_order import insist, khepera3
from bns.models.khepera3 import Firmware, firmware

LARGEST = 43_000  # speed units, firmware < 3, regulated (manual 2.2, p. 14)
NEWEST = 9  # firmware versions beyond it are not known and refused
TIMEOUT = 0.15  # s for an answer: 7 ms of wire, two Bluetooth latencies; assumed
RETRIES = 6
QUIET = 0.02  # s without a byte after which the line counts as silent
SLICE = 0.03  # s between two looks after the watchdog while an answer is waited for
SILENT = 0.12  # s without a byte, after which a moving robot is stopped
UNANSWERED = 0.3  # s without a proper answer, after which a moving robot is stopped
BABBLE = 256  # bytes that are no answer, after which a moving robot is stopped
TURNING = 1000  # speed units of a wheel that turned until a moment ago
STANDS = 0.005  # m/s; slower in `LOOKS` readings running, a wheel stands
LOOKS = 3
STOPPING = 1.0  # s for the robot to acknowledge a stop


class Guard(Protocol):
    """What has to stand behind a moving robot, see `bns.hardware.safety.watchdog`."""

    def feed(self, *, moving: bool) -> None:
        """Say that the process is alive; raises if the guard has fired."""
        ...


class Drive(NamedTuple):
    """A set point that the robot has acknowledged.

    Attributes:
        at: when it held: the middle of the exchange, if both ways take as long [s].
        units: left and right [speed units].
        took: duration of the exchange [s], longer where it was repeated.
    """

    at: float
    units: tuple[int, int]
    took: float = 0.0


class Khepera3:
    """A Khepera III on a line.

    Args:
        line: to it.
        clock: to wait on.
        faults: where what goes wrong on the line is noted.
        guard: without one, `drive` refuses to move the robot.
        limit: largest speed over the floor [m/s]; faster commands are refused.
        timeout: for an answer [s].

    Attributes:
        wheels: diameters of the left and right wheel as shares of nominal.
        round_trips: duration of each exchange that went well [s], the newest 1000.
    """

    def __init__(
        self,
        line: Line,
        clock: Clock,
        *,
        faults: FaultLog | None = None,
        guard: Guard | None = None,
        limit: float = 0.15,
        timeout: float = TIMEOUT,
    ):
        self.line, self.clock, self.guard = line, clock, guard
        self.faults = faults if faults is not None else FaultLog(clock)
        self.limit, self.timeout = limit, timeout
        self._firmware: Firmware | None = None
        self.version: tuple[int, int] = (0, 0)
        self.wheels = (1.0, 1.0)
        self.round_trips: list[float] = []
        self._moving = self._stopping = False
        self._came = 0  # bytes since the last proper answer

    @property
    def patience(self) -> float:
        """Time to wait for an answer [s]: three of the slowest of late, if that is less
        than the timeout; a stop must not wait long behind a lost byte.
        """
        if len(self.round_trips) < 10:
            return self.timeout
        return min(max(3 * max(self.round_trips[-20:]), 0.05), self.timeout)

    def identify(self) -> tuple[int, int]:
        """Ask for the firmware and take its units.

        Returns:
            version, revision.

        Raises:
            BnsError: nothing answers, another device does, or the firmware is not
                known. Nothing has moved.
        """
        heard: list[bytes] = []
        try:
            answer = self.ask(b"B\n", "b", heard=heard)
        except LinkError as error:
            raise port_error(b"".join(heard)) from error
        self.version = (answer[0], answer[1])
        if not 1 <= self.version[0] <= NEWEST:
            raise BnsError(
                f"Firmware {self.version[0]}.{self.version[1]} is not known (1 to "
                f"{NEWEST} are): its units could be anything, so nothing was moved."
            )
        self._firmware = firmware(self.version[0])
        return self.version

    def ask(
        self, command: bytes, letter: str, *, heard: list[bytes] | None = None
    ) -> tuple[int, ...]:
        """Send a command and give the numbers of its answer.

        Args:
            command: the line, with its ending.
            letter: of the answer.
            heard: collects every byte that came, for a diagnosis of the port.

        Raises:
            LinkError: no proper answer in any of the tries, or the line is dead.
        """
        return self._exchange(
            command, lambda line: protocol.numbers(line, letter), heard
        )

    def drive(self, left: float, right: float, *, times: int = 1) -> Drive:
        """Set the wheels' speeds over the floor [m/s].

        Args:
            left, right: within the limit.
            times: how often it is sent; twice on a line that loses bytes, because a
                digit lost on the way is acknowledged like any other number.

        Raises:
            BnsError: too fast, nobody guards, or the firmware is not known yet.
            LinkError: not acknowledged.
        """
        _ = self.units
        if max(abs(left), abs(right)) > self.limit * (1 + 1e-9):
            raise BnsError(
                f"Speed {max(abs(left), abs(right)):.3g} m/s is above the limit of "
                f"{self.limit:.3g} m/s: give slower commands."
            )
        moving = bool(left or right)
        if moving and self.guard is None:
            raise BnsError("Nobody guards the robot: it moves with a watchdog only.")
        self._moving = self._moving or moving  # until `stop` has seen it stand
        if self.guard is not None:
            self.guard.feed(moving=self._moving)
        pair = self._device(left, right)
        command = protocol.speeds(*pair)
        begin = self.clock.now()
        self.ask(command, "d")
        took = self.clock.now() - begin
        for _ in range(times - 1):
            self.ask(command, "d")
        return Drive(begin + (took + protocol.longer(command)) / 2, pair, took)

    @property
    def units(self) -> Firmware:
        """Units of the firmware.

        Raises:
            BnsError: it is not known yet.
        """
        if self._firmware is None:
            raise BnsError("The firmware is not known yet: call identify() first.")
        return self._firmware

    def speed(self, units: float) -> float:
        """Over the floor, with the nominal wheel [m/s], of a speed in device units."""
        return float(self.units.speed(float(units)))

    def _device(self, left: float, right: float) -> tuple[int, int]:
        """Speeds over the floor [m/s] in device units."""
        a, b = self.wheels
        units = self.units.units
        return round(units(left / a)), round(units(right / b))

    def lead(self, *pair: float) -> float:
        """How long before its moment a set point has to be sent [s].

        Args:
            pair: left and right [m/s].
        """
        recent = self.round_trips[-20:]
        command = protocol.speeds(*self._device(*pair))
        return (sorted(recent)[len(recent) // 2] + protocol.longer(command)) / 2

    def stop(self) -> None:
        """Order both wheels to stop, then see that they stand.

        The order is written before anything else is done, and nothing that fails
        keeps it from being written again. A robot that does not confirm it is left to
        the watchdog, which goes on.

        Raises:
            LinkError: the robot does not confirm it.
        """
        self._stopping = True
        try:
            for _ in range(3):
                if self._ordered() and self._standing():
                    break
            else:
                raise LinkError(
                    "The robot does not confirm that it stands: check the link; the "
                    "watchdog goes on trying."
                )
        finally:
            self._stopping = False
        self._moving = False
        self._calm()

    def paused(self) -> bool:
        """Order a stop and see whether the wheels have turned until then."""
        self.ask(protocol.STOP, "d")
        return max(map(abs, self.speeds())) > TURNING

    def _ordered(self) -> bool:
        """Write the order until the robot acknowledges it; whether it does."""
        return insist(
            khepera3()._replace(acknowledged=2),
            self.line.order,
            self.line.read,
            self.clock.now,
            patience=STOPPING,
            meanwhile=self._calm,
        )

    def _calm(self) -> None:
        """Feed the guard; whatever it says, the robot is being stopped already."""
        if self.guard is not None:
            with contextlib.suppress(SafetyStop, Void):
                self.guard.feed(moving=self._moving)

    def alive(self) -> None:
        """Feed the guard of a robot that moves; see that the line is its own.

        Raises:
            SafetyStop, Void: from the guard, or another program has opened the port.
        """
        if self._stopping:
            self._calm()
        elif self.guard is not None and self._moving:
            self.guard.feed(moving=True)
            if self.line.intruder():
                raise Void("another program has opened the port")

    def _standing(self) -> bool:
        """Whether the wheels slow down to a stand within a moment, and stay."""
        looks = 0
        for _ in range(16):
            left, right = map(self.speed, self.speeds())
            looks = looks + 1 if max(abs(left), abs(right)) < STANDS else 0
            if looks == LOOKS:
                return True
            self.clock.sleep(SLICE)
        return False

    def speeds(self) -> tuple[int, int]:
        """Measured speeds, left and right [speed units]."""
        left, right = self.ask(b"E\n", "e")
        return left, right

    def positions(self) -> tuple[int, int]:
        """Position counters, left and right [counts]."""
        left, right = self.ask(b"R\n", "r")
        return left, right

    def proximity(self) -> tuple[int, ...]:
        """11 proximity values, larger = nearer."""
        return self.ask(b"N\n", "n")[: protocol.SENSORS]

    def ambient(self) -> tuple[int, ...]:
        """11 ambient light values, smaller = more light."""
        return self.ask(b"O\n", "o")[: protocol.SENSORS]

    def battery(self, what: int = 0) -> float:
        """Battery: 0 voltage [V], 3 remaining [mAh], 4 temperature [C], 5 left [%]."""
        return self._exchange(f"V,{what}\n".encode(), protocol.decimal)

    def everything(self) -> protocol.Reading:
        """All sensors, speeds and positions in one binary frame.

        Raises:
            LinkError: no whole frame in any of the tries.
        """
        return self._repeat(self._frame, "X")

    def _exchange(
        self,
        command: bytes,
        understood: Callable,
        heard: list[bytes] | None = None,
    ) -> Any:
        what = command.decode().strip()
        return self._repeat(lambda: self._line(command, understood, heard), what)

    def _repeat(self, once: Callable, what: str) -> Any:
        since, self._came = self.clock.now(), 0
        for _ in range(RETRIES + 1):
            self.alive()
            begin = self.clock.now()
            answer = once()
            if answer is not None:
                self.round_trips.append(self.clock.now() - begin)
                del self.round_trips[:-1000]
                return answer
            if self._moving and not self._stopping:
                self._doubt(since, what)
            self.resynchronise()
        raise LinkError(
            f"No proper answer to {what!r} in {RETRIES + 1} tries: check the link; a "
            "robot that was moving may still be."
        )

    def _doubt(self, since: float, what: str) -> None:
        """Give up a robot that moves and does not answer.

        Args:
            since: when it was first asked [s].
            what: it was asked.

        Raises:
            Void: it has not answered for too long; the caller stops it.
        """
        waited = self.clock.now() - since
        if not self._came and waited > SILENT:
            raise Void(f"the robot said nothing to {what!r} for {waited:.2f} s")
        if self._came > BABBLE:
            raise Void(f"the line goes on talking ({self._came} bytes to {what!r})")
        if waited > UNANSWERED:
            raise Void(f"no proper answer to {what!r} in {waited:.2f} s")

    def _line(
        self, command: bytes, understood: Callable, heard: list[bytes] | None
    ) -> Any:
        """One try: lines are read until one is the answer or time is up."""
        self.line.discard()
        self.line.write(command)
        until, buffer = self.clock.now() + self.patience, b""
        while (left := until - self.clock.now()) > 0:
            data = self.line.read(min(left, SLICE))
            self.alive()
            self._came += len(data)
            if self._came > BABBLE and self._moving:
                break
            if heard is not None:
                heard.append(data)
            buffer = (buffer + data)[-4096:]
            while (cut := protocol.ending(buffer)) >= 0:
                line, buffer = buffer[:cut].strip(b"\r\n"), buffer[cut + 1 :]
                if not line:
                    continue
                answer = understood(line)
                if answer is not None:
                    return answer
                self.faults.note("garbled answer", command, line)
        kind = "cut answer" if buffer else "no answer"
        self.faults.note(kind, command, buffer)
        return None

    def _frame(self) -> protocol.Reading | None:
        self.line.discard()
        self.line.write(b"X\n")
        until, data = self.clock.now() + self.timeout, b""
        size = protocol.FRAME.size
        while len(data) < size and (left := until - self.clock.now()) > 0:
            data += self.line.read(min(left, SLICE))
            self.alive()
        reading = protocol.frame(data[:size])
        if reading is None:
            self.faults.note("broken frame", b"X", data[:size])
        return reading

    def resynchronise(self) -> None:
        """End a half-sent line and wait until nothing comes any more."""
        self.line.write(b"\n")  # empty lines are ignored
        until = self.clock.now() + 0.2
        while self.clock.now() < until and self.line.read(QUIET):
            self.alive()
            if self._moving and not self._stopping and self._came > BABBLE:
                break
        self.line.discard()


def port_error(heard: bytes) -> BnsError:
    """What it means that `B` got no answer."""
    if b"\xff\xff" in heard:
        return BnsError(
            "What answers on this port speaks the Dynamixel protocol: a hexapod, no "
            "Khepera III. Give --robot phantomx or another --port."
        )
    text = heard.strip()
    if text and all(32 <= c < 127 or c in b"\r\n" for c in text):
        return BnsError(
            f"What answers on this port ({text[:40].decode()!r}) is no Khepera III: "
            "give another --port."
        )
    if text:
        return BnsError(
            "What comes from this port cannot be read: the baud rate is wrong; the "
            f"Khepera III talks at {protocol.BAUD}."
        )
    return BnsError(
        "Nothing answers on this port: switch the Khepera III on, check cable or "
        f"Bluetooth, that it talks at {protocol.BAUD} baud, and that it is no hexapod "
        "(--robot phantomx)."
    )
