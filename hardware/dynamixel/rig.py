"""A hexapod, a camera and a watchdog, connected and checked; nothing moves for that."""

import contextlib
from dataclasses import dataclass
from pathlib import Path

from bns.errors import BnsError
from bns.hardware.clock import Clock, RealClock, urgent
from bns.hardware.dynamixel import joints, packets
from bns.hardware.dynamixel.bus import EMPTY, Bus
from bns.hardware.dynamixel.walker import Walker
from bns.hardware.faults import FaultLog, LinkError
from bns.hardware.line import check_port
from bns.hardware.rig import EMULATED, look
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.safety.watchdog_client import WatchdogClient
from bns.hardware.tracking.eyes import Eyes


@dataclass
class HexapodRig:
    """What a session with a hexapod consists of.

    Attributes:
        bus: its servos.
        eyes: its tracker.
        clock: time of the session.
        limits: bounds that hold.
        operator: who may stop it.
        faults: what went wrong so far.
        watchdog: to the watchdog.
        walker: moves it under the limits.
    """

    bus: Bus
    eyes: Eyes
    clock: Clock
    limits: Limits
    operator: Operator
    faults: FaultLog
    watchdog: WatchdogClient
    walker: Walker

    def others(self) -> list[str]:
        """Programs that have the port open as well, as "name (number)"."""
        return self.bus.others()

    def close(self) -> None:
        """Torque off; give port and camera back; a dead line is the watchdog's."""
        try:
            with contextlib.suppress(LinkError):
                self.bus.close()
        finally:
            self.eyes.close()
            self.watchdog.release()


def connect(
    port: str,
    names: tuple[str, ...],
    camera: str = EMULATED,
    *,
    calibration: str = "",
    servos: str = "",
    limits: Limits | None = None,
    log: Path | str | None = None,
) -> HexapodRig:
    """Open bus and camera, ask every servo who it is, start the watchdog.

    Args:
        port: the robot's device.
        names: of the joints, in the order of the commands.
        camera: number of a camera, a video file, or "emulated".
        calibration: file of the camera's calibration; needed for a real one.
        servos: the robot's own file; needed for a real one.
        limits: bounds of the session.
        log: file for what goes wrong.

    Raises:
        BnsError: something is missing or wrong. Nothing has moved.
    """
    clock, limits = RealClock(), limits or Limits()
    urgent()
    check_port(port)
    table = known(servos, camera)
    faults = FaultLog(clock, log)
    bus = Bus(port, table, clock, faults=faults)
    try:
        bus.identify()
        charged(bus)
        eyes = look(port, camera, calibration, "phantomx")
        try:
            watchdog = WatchdogClient(
                bus.fileno(),
                port,
                packets.BAUD,
                "phantomx",
                servo=table[0].id,
            )
        except BnsError:
            eyes.close()
            raise
    except BnsError:
        bus.release()
        raise
    bus.guard = watchdog
    operator = Operator()
    walker = Walker(
        bus,
        eyes,
        clock,
        limits=limits,
        operator=operator,
        faults=faults,
        names=names,
    )
    return HexapodRig(bus, eyes, clock, limits, operator, faults, watchdog, walker)


def known(servos: str, camera: str) -> tuple[joints.Joint, ...]:
    """The joints of the robot.

    Raises:
        BnsError: a real robot whose zeros were not calibrated, no such file.
    """
    if not servos and camera != EMULATED:
        raise BnsError(
            "The servos are not calibrated: make their file with `bns hardware "
            "calibrate --robot phantomx --what servos` and give it as --servos FILE."
        )
    return joints.read(servos or joints.FILE)


def charged(bus: Bus) -> float:
    """The bus's voltage [V].

    Raises:
        BnsError: too low to start.
    """
    volts = bus.volts()
    if volts < EMPTY:
        raise BnsError(
            f"The bus has {volts:.1f} V, less than {EMPTY:g} V: charge the battery."
        )
    return volts
