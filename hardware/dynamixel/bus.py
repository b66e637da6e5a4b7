"""The bus through ROBOTIS's SDK, with its defects worked round.

What is worked round of dynamixel-sdk 4.1: an exception inside a transaction leaves the
port marked as in use, so that every later call fails; opening a missing port raises
instead of saying no; only the first of several error bits is named; there is no bulk
read on AX servos; a line that goes on talking is read without an end; time-outs are on
the wall clock. It is not safe for several threads: neither is this.
"""

import contextlib
import time
from collections.abc import Mapping, Sequence
from typing import Any

from bns.errors import BnsError, MissingDependencyError, install
from bns.hardware.clock import Clock
from bns.hardware.dynamixel import packets
from bns.hardware.dynamixel.joints import Joint
from bns.hardware.faults import FaultLog, LinkError, SafetyStop, Void
from bns.hardware.khepera.driver import Guard
from bns.hardware.line import Openers, check_port, claim
from bns.hardware.safety.stop_order import insist, phantomx
from bns.hardware.safety.watchdog import receive, send
from bns.worlds.physics.observe import OVERLOAD_TIME, SATURATED, STALLED

TRIES = 4
HOT, EMPTY = 65, 9.9  # C, V: beyond it the robot rests
SLOWEST = STALLED / packets.SPEED_UNIT  # units; slower, a servo stands still
BABBLE = 64  # bytes to one question, after which a robot with torque is stopped
STOPPING = 0.5  # s for a servo to acknowledge a stop
LATENCY = 0.02  # s allowed for an answer beside its bytes


class Overload(SafetyStop):
    """A servo pushes in vain: the trial ends, the robot need not."""


class Bus:
    """Servos on a port.

    Args:
        port: device.
        joints: which servo is which.
        clock: of the session.
        faults: where what goes wrong is noted.
        guard: has to watch while torque is on.
        latency: allowed for an answer beside its bytes [s].

    Raises:
        BnsError: no such port, in use, no SDK.

    Attributes:
        states: newest state of each servo by its number.
    """

    def __init__(
        self,
        port: str,
        joints: Sequence[Joint],
        clock: Clock,
        *,
        faults: FaultLog | None = None,
        guard: Guard | None = None,
        latency: float = LATENCY,
    ):
        check_port(port)
        sdk = _sdk()
        self.joints = tuple(joints)
        self.clock, self.guard = clock, guard
        self.faults = faults if faults is not None else FaultLog(clock)
        self._port = _port(sdk, port, latency)
        self._openers = Openers(port)
        self._protocol = sdk.PacketHandler(1.0)
        self._goals = sdk.GroupSyncWrite(self._port, self._protocol, packets.GOAL, 2)
        self._sdk = sdk
        self.states: dict[int, packets.State] = {}
        self._loaded: dict[int, float] = {}
        self._next, self._on = 0, False

    def fileno(self) -> int:
        """The open file's number, for the watchdog."""
        return int(self._port.ser.fileno())

    def others(self) -> list[str]:
        """Programs that have the port open as well, as "name (number)"."""
        return self._openers.others()

    def identify(self) -> None:
        """See that every servo is there, once, and is an AX-12A.

        Raises:
            BnsError: one is missing, doubled, or another model. Nothing has moved.
        """
        missing: list[int] = []
        garbled: list[int] = []
        others: list[int] = []
        for joint in self.joints:
            results = [self._call("ping", joint.id) for _ in range(3)]
            good = [value for value, result, _ in results if result == 0]
            if not good:
                corrupt = any(r == self._sdk.COMM_RX_CORRUPT for _, r, _ in results)
                (garbled if corrupt else missing).append(joint.id)
            elif good[0] != packets.MODEL:
                others.append(joint.id)
        if len(missing) == len(self.joints):
            raise BnsError(
                "No servo answers: switch the hexapod on, check the adapter, that the "
                f"servos talk at {packets.BAUD} baud, and that it is no Khepera III."
            )
        if garbled:
            raise BnsError(
                f"Servos {garbled} answer on top of another: two have one number; "
                "connect them one by one and give each its own."
            )
        if missing:
            raise BnsError(
                f"Servos {missing} do not answer: check their cables; a number given "
                "twice elsewhere on the bus shows like this as well."
            )
        if others:
            raise BnsError(f"Servos {others} are no AX-12A: nothing was moved.")

    def read(self, servo: int) -> packets.State:
        """The state of a servo; one read of eight bytes.

        Raises:
            LinkError: no proper answer in any of the tries.
            Void: the same, of a robot whose torque is on; the caller stops it.
        """
        for _ in range(TRIES):
            values, result, error = self._call("readTxRx", servo, packets.PRESENT, 8)
            state = packets.state(list(values)) if result == 0 else None
            if state is not None:
                if error:
                    self.faults.note("servo error", str(servo), packets.words(error))
                self.states[servo] = state
                return state
            self.faults.note("no answer" if result else "bad state", str(servo))
            if self.guard is not None and self._on:
                self.guard.feed(moving=True)
        raise self._mute(servo)

    def _mute(self, servo: int) -> BnsError:
        """What to raise about a servo that does not answer; one that holds is stopped.

        The stop shows whether the bus is dead.
        """
        said = f"servo {servo} gave no proper answer in {TRIES} tries"
        if self._on:
            return Void(said)
        return LinkError(f"{said.capitalize()}: check its cable.")

    def holds(self, servo: int) -> bool:
        """Whether the torque of a servo is on.

        Raises:
            LinkError: no proper answer.
        """
        for _ in range(TRIES):
            value, result, _ = self._call("read1ByteTxRx", servo, packets.TORQUE)
            if result == 0:
                return bool(value)
            self.faults.note("no answer", str(servo))
            if self.guard is not None and self._on:
                self.guard.feed(moving=True)
        raise self._mute(servo)

    def powered(self, count: int = 1) -> None:
        """See that the next few servos still hold.

        Raises:
            Void: one does not: it was reset, or had no power for a moment.
            LinkError: no proper answer.
        """
        for shift in range(count):
            joint = self.joints[(self._next + shift) % len(self.joints)]
            if not self.holds(joint.id):
                raise Void(f"{joint.name} has lost its torque")

    def look(self, count: int = 2) -> list[tuple[Joint, packets.State]]:
        """Read the next few servos in turn and see that they are well.

        Raises:
            SafetyStop: one is too hot, overloaded (`Overload`), or the battery is low.
        """
        seen = []
        for _ in range(count):
            joint = self.joints[self._next % len(self.joints)]
            self._next += 1
            seen.append((joint, self.read(joint.id)))
            self._well(*seen[-1])
        return seen

    def _well(self, joint: Joint, state: packets.State) -> None:
        if state.temperature >= HOT:
            raise SafetyStop(
                f"{joint.name} has {state.temperature} C", "let it cool down"
            )
        if state.voltage < EMPTY:
            raise SafetyStop(f"the bus has {state.voltage} V", "charge the battery")
        if abs(state.load) < SATURATED or abs(state.speed) > SLOWEST:
            self._loaded.pop(joint.id, None)
            return
        since = self._loaded.setdefault(joint.id, self.clock.now())
        if self.clock.now() - since > OVERLOAD_TIME:
            self._loaded.clear()
            raise Overload(f"{joint.name} is overloaded", "free the leg")

    def write(self, angles: Mapping[str, float]) -> None:
        """Send the goals of all joints in one packet.

        Args:
            angles: by name of the joint [rad]; kept between the end stops.

        Raises:
            BnsError: nobody guards.
            LinkError: the line is dead.
            Void: another program has opened the port.
        """
        if self.guard is None:
            raise BnsError("Nobody guards the robot: it moves with a watchdog only.")
        self.guard.feed(moving=True)
        if self._on and self._openers.intruder():
            raise Void("another program has opened the port")
        self._goals.clearParam()
        for joint in self.joints:
            units = joint.units(angles[joint.name])
            self._goals.addParam(joint.id, [units & 0xFF, units >> 8])
        result = self._guarded(self._goals.txPacket)
        if result != 0:
            raise LinkError("The goals could not be sent: check the adapter.")

    def pace(self, speed: float) -> None:
        """Set the moving speed of all servos [rad/s]; sent three times."""
        units = min(max(round(speed / packets.SPEED_UNIT), 1), 1023)
        for _ in range(3):
            self._call("write2ByteTxOnly", packets.BROADCAST, packets.SPEED, units)

    def volts(self) -> float:
        """The lowest voltage that a servo reads [V]."""
        return min(self.read(joint.id).voltage for joint in self.joints)

    def power(self) -> None:
        """Switch the torque of all servos on."""
        self._on = True
        self._call("write1ByteTxOnly", packets.BROADCAST, packets.TORQUE, 1)

    def stop(self) -> None:
        """Order the torque of all servos off, then see that it is.

        The order is written before anything else is done, and nothing that fails
        keeps it from being written again. A robot that does not confirm it is left to
        the watchdog, which goes on.

        Raises:
            LinkError: the servo that is asked does not confirm it.
        """
        import termios

        order = phantomx(self.joints[0].id)
        try:
            confirmed = insist(
                order,
                lambda data: send(self.fileno(), data),
                lambda seconds: receive(self.fileno(), seconds),
                self.clock.now,
                patience=STOPPING,
                meanwhile=self._calm,
            )
        except (OSError, termios.error, TypeError, ValueError) as error:  # closed
            raise LinkError(f"The bus is dead ({error}): check it.") from error
        if not confirmed:
            raise LinkError(
                "The servos do not confirm that their torque is off: check the bus; "
                "the watchdog goes on trying."
            )
        self._on = False
        self._calm()

    def _calm(self) -> None:
        """Feed the guard; whatever it says, the robot is being stopped already."""
        if self.guard is not None:
            with contextlib.suppress(SafetyStop, Void):
                self.guard.feed(moving=self._on)

    def close(self) -> None:
        """Torque off, port given back."""
        try:
            self.stop()
        finally:
            self.release()

    def release(self) -> None:
        """Give the port back and send nothing."""
        self._openers.close()
        self._port.closePort()

    def _call(self, name: str, *words: int) -> Any:
        function = getattr(self._protocol, name)
        self._port.came = 0
        made = self._guarded(lambda: function(self._port, *words))
        if self._port.came > BABBLE:
            said = f"bus goes on talking ({self._port.came} bytes to {name})"
            if self._on:
                raise Void(f"the {said}")
            raise LinkError(f"The {said}: check cable and adapter.")
        return made

    def _guarded(self, function: Any) -> Any:
        """A call of the SDK; the port is free afterwards, whatever happened."""
        import termios

        try:
            return function()
        except (OSError, termios.error, IndexError, TypeError) as error:
            if isinstance(error, OSError | termios.error):
                raise LinkError(f"The bus is dead ({error}): check it.") from error
            self.faults.note("broken packet", str(error))  # the SDK trips over it
            return [], self._sdk.COMM_RX_CORRUPT, 0
        finally:
            self._port.is_using = False


def _sdk() -> Any:
    try:
        import dynamixel_sdk
    except ImportError as error:
        raise MissingDependencyError(
            "a hexapod on its bus", "dynamixel-sdk", install("hardware")
        ) from error
    return dynamixel_sdk


def _port(sdk: Any, name: str, latency: float) -> Any:
    """The SDK's port, opened for this process alone, with a shorter time allowance."""

    class Port(sdk.PortHandler):
        def setPacketTimeout(self, packet_length: int) -> None:
            self.packet_start_time = self.getCurrentTime()
            self.packet_timeout = self.tx_time_per_byte * packet_length + latency * 1e3

        def getCurrentTime(self) -> float:
            return time.monotonic() * 1e3

        came = 0  # bytes of an answer and of what else came

        def readPort(self, length: int) -> bytes:
            """Up to so many bytes, see `PortHandler.readPort`."""
            # the SDK looks at the time in a silent moment only; late answers are good
            if self.came > BABBLE and self.isPacketTimeout():
                return b""
            # the SDK asks without a pause: one core busy, nobody else's turn; and it
            # takes a line whose bytes another program has read for a dead one
            data = receive(self.ser.fileno(), 0.0005, length)
            self.came += len(data)
            return data

    port = Port(name)
    try:
        good = port.openPort() and port.setBaudRate(packets.BAUD)
        port.ser.exclusive = True
        port.ser.write_timeout = 0.05
        claim(port.ser.fileno())
    except (OSError, ValueError) as error:
        raise BnsError(
            f"Port {name} cannot be opened ({error}): end other programs on it, check "
            "that it is the hexapod's adapter."
        ) from error
    if not good:
        raise BnsError(f"Port {name} does not take {packets.BAUD} baud.")
    return port
