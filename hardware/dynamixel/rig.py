"""A hexapod, a camera and a watchdog, connected and checked; nothing moves for that.

Zeros of its servos are positions read while its legs are half-way: the torque stays
off, a person or a jig holds the legs where every joint of the model is at 0
(`models/phantomx`: coxae straight, femora and tibiae half-way).
"""

import contextlib
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bns.errors import BnsError
from bns.hardware.clock import Clock, RealClock, urgent
from bns.hardware.dynamixel import joints, packets
from bns.hardware.dynamixel.bus import EMPTY, Bus
from bns.hardware.dynamixel.joints import Joint
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


READS = 9  # of each servo
SCATTER = 3  # units between them; more = the leg was moved
FAR = 60  # units (18 deg) from half-way; farther = the leg is somewhere else


def calibrate(port: str, known: str, out: Path) -> Iterator[str]:
    """Read every servo and write the robot's file; says what was found.

    Args:
        port: of the robot.
        known: file with numbers and signs; empty = the one that comes with the driver.
        out: file to write.

    Raises:
        BnsError: a servo is missing, holds, moves, or is far from half-way.
    """
    bus = Bus(port, joints.read(known or joints.FILE), RealClock())
    try:
        bus.identify()
        holding = [j.name for j in bus.joints if bus.holds(j.id)]
        if holding:
            raise BnsError(
                f"{', '.join(holding[:3])}{' ...' * (len(holding) > 3)} hold their "
                "place: switch the robot off and on, put its legs half-way by hand."
            )
        made = [found(bus, joint) for joint in bus.joints]
    finally:
        bus.release()
    joints.write(out, tuple(made), said="Zeros by `bns hardware calibrate`.")
    off = [m.zero - 512 for m in made]
    yield f"zeros   {min(off):+d} to {max(off):+d} units from half-way, 18 servos"


def found(bus: Bus, joint: Joint) -> Joint:
    """A joint with its zero where it stands now; its end stops move along.

    Raises:
        BnsError: it moves, or is far from half-way.
    """
    seen = [bus.read(joint.id).position for _ in range(READS)]
    zero = round(float(np.median(seen)))
    if max(seen) - min(seen) > SCATTER:
        raise BnsError(f"{joint.name} moves while it is read: hold the leg still.")
    if abs(zero - 512) > FAR:
        raise BnsError(
            f"{joint.name} reads {zero}, {abs(zero - 512)} units from half-way: put "
            "the leg half-way, or mount the horn anew."
        )
    moved = zero - joint.zero
    low, high = (min(max(stop + moved, 0), 1023) for stop in (joint.low, joint.high))
    return joint._replace(zero=zero, low=low, high=high)


def report(port: str, servos: str = "") -> Iterator[str]:
    """Look at every servo; nothing moves.

    Args:
        port: of the robot.
        servos: its file; empty = the one that comes with the driver.

    Raises:
        BnsError: the port, a servo or the battery is not as it should be.
    """
    clock = RealClock()
    bus = Bus(port, joints.read(servos or joints.FILE), clock)
    try:
        bus.identify()
        if not servos:
            yield "zeros      assumed; see `bns hardware calibrate --what servos`"
        yield f"servos     {len(bus.joints)} AX-12A at {packets.BAUD} baud"
        begin = clock.now()
        for joint in bus.joints:
            state = bus.read(joint.id)
            yield (
                f"{joint.name:<9} id {joint.id:>2}  {joint.angle(state.position):+.3f} "
                f"rad, load {state.load:+.2f}, {state.voltage:.1f} V, "
                f"{state.temperature} C"
            )
        took = clock.now() - begin
        yield f"sweep      {took * 1e3:.1f} ms for all, {len(bus.faults)} faults"
        if min(state.voltage for state in bus.states.values()) < EMPTY:
            raise BnsError(f"The bus has less than {EMPTY} V: charge the battery.")
    finally:
        bus.release()
