"""A robot, a camera and a watchdog, connected and checked; nothing moves for that.

`report` says what there is to see before a Khepera III is let go.
"""

from collections.abc import Iterator
from dataclasses import dataclass, field, replace
from pathlib import Path
from statistics import median

import numpy as np

from bns.errors import BnsError
from bns.hardware.clock import Clock, RealClock, urgent
from bns.hardware.driving import homing
from bns.hardware.driving.motion import Mover, Point
from bns.hardware.driving.odometry import Wheels
from bns.hardware.driving.wheels import Following
from bns.hardware.faults import FaultLog
from bns.hardware.khepera import protocol
from bns.hardware.khepera.driver import Khepera3
from bns.hardware.line import Line, SerialLine, check_port
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.safety.watchdog_client import WatchdogClient
from bns.hardware.tracking.eyes import Eyes

EMULATED = "emulated"
SIZE = (1280, 720)  # px of the emulated camera


@dataclass
class Rig:
    """What a session with a Khepera III consists of.

    Attributes:
        robot: its driver.
        eyes: its tracker.
        clock: time of the session.
        limits: bounds that hold.
        operator: who may stop it.
        faults: what went wrong so far.
        line: to the robot.
        watchdog: to the watchdog; None in virtual time.
        following: how the wheels follow, as far as was seen.
    """

    robot: Khepera3
    eyes: Eyes
    clock: Clock
    limits: Limits
    operator: Operator
    faults: FaultLog
    line: Line
    watchdog: WatchdogClient | None = None
    following: Following = field(default_factory=Following)

    def mover(self) -> Mover:
        """What drives the robot under the limits."""
        return Mover(
            self.robot,
            self.eyes,
            self.clock,
            limits=self.limits,
            operator=self.operator,
            faults=self.faults,
            following=self.following,
        )

    def others(self) -> list[str]:
        """Programs that have the port open as well, as "name (number)"."""
        return self.line.others()

    def close(self) -> None:
        """Give port and camera back; the robot stands."""
        self.eyes.close()
        if self.watchdog is not None:
            self.watchdog.release()
        self.line.close()


def connect(
    port: str,
    camera: str = EMULATED,
    *,
    calibration: str = "",
    wheels: str = "",
    limits: Limits | None = None,
    log: Path | str | None = None,
) -> Rig:
    """Open port and camera, ask the robot who it is, start the watchdog.

    Args:
        port: the robot's device.
        camera: number of a camera, a video file, or "emulated".
        calibration: file of the camera's calibration; needed for a real one.
        wheels: file of the wheels' sizes; empty = nominal.
        limits: bounds of the session.
        log: file for what goes wrong.

    Raises:
        BnsError: something is missing or wrong. Nothing has moved.
    """
    clock, limits = RealClock(), limits or Limits()
    sizes = Wheels.read(wheels).factors if wheels else (1.0, 1.0)
    urgent()
    check_port(port)
    faults = FaultLog(clock, log)
    line = SerialLine(port, protocol.BAUD)
    try:
        robot = Khepera3(line, clock, faults=faults, limit=limits.speed)
        robot.identify()
        robot.wheels = sizes
        battery(robot, limits)
        eyes = look(port, camera, calibration)
        try:
            watchdog = WatchdogClient(line.fileno(), port, protocol.BAUD, "khepera3")
        except BnsError:
            eyes.close()
            raise
    except BnsError:
        line.close()
        raise
    robot.guard = watchdog
    return Rig(robot, eyes, clock, limits, Operator(), faults, line, watchdog)


def battery(robot: Khepera3, limits: Limits) -> float:
    """The battery's voltage [V].

    Raises:
        BnsError: too low to start.
    """
    volts = robot.battery()
    if volts < limits.battery:  # a digit may have been lost on the line
        volts = sorted((volts, robot.battery(), robot.battery()))[1]
    if volts < limits.battery:
        raise BnsError(
            f"The battery has {volts:.1f} V, less than {limits.battery:g} V: charge it."
        )
    return volts


def look(port: str, camera: str, calibration: str, robot: str = "khepera3") -> Eyes:
    """Tracker and camera.

    Args:
        port: of the robot, where it is emulated.
        camera: number, a video file, or "emulated".
        calibration: file of the camera's calibration.
        robot: whose tag is looked for.

    Raises:
        BnsError: no such camera, or it is not calibrated.
    """
    from bns.hardware.tracking.camera import Camera
    from bns.hardware.tracking.eyes import DeviceCamera, Source, ThreadedEyes, VideoFile
    from bns.hardware.tracking.marker import MARKERS
    from bns.hardware.tracking.tracker import CROOKED, LEANING, Tracker

    if not camera:
        raise BnsError("No camera was given: give --camera NUMBER, FILE or emulated.")
    marker, crooked = MARKERS[robot], LEANING if robot == "phantomx" else CROOKED
    if camera == EMULATED:
        from bns.hardware.emulators.camera import EmulatedCamera, painter

        known = Camera.read(calibration) if calibration else Camera.overhead(SIZE)
        ideal = replace(Camera.overhead(known.size), latency=0.0)
        source: Source = EmulatedCamera(port, painter(robot, ideal))
        return ThreadedEyes(source, Tracker(known, marker, crooked=crooked))
    if not calibration:
        raise BnsError(
            "The camera is not calibrated: make a calibration with `bns hardware "
            "calibrate` and give it as --calibration FILE."
        )
    known = Camera.read(calibration)
    if camera.isdecimal():
        source = DeviceCamera(int(camera), known.size)
    elif Path(camera).exists():
        source = VideoFile(camera)
    else:
        raise BnsError(f"No camera {camera!r}: give its number, a file or 'emulated'.")
    return ThreadedEyes(source, Tracker(known, marker, crooked=crooked))


ENOUGH = 12.0  # pictures a second, so that one that is late stops no robot
PICTURES = 20  # looked at for rate and scatter


def report(rig: Rig, *, move: bool = False) -> Iterator[str]:
    """Check after check as a line.

    Args:
        rig: connected.
        move: turn and drive a little as well.

    Raises:
        BnsError: what is wrong; nothing has moved without `move`.
    """
    robot = rig.robot
    yield f"firmware   {robot.version[0]}.{robot.version[1]}, {robot.units.name}"
    yield f"battery    {battery(robot, rig.limits):.1f} V"
    trips = _trips(rig)
    yield (
        f"link       {median(trips) * 1e3:.1f} ms a round trip, worst of {len(trips)}: "
        f"{max(trips) * 1e3:.1f} ms; {len(rig.faults)} faults"
    )
    yield f"wheels     speeds {robot.speeds()}, positions {robot.positions()}"
    yield f"proximity  {robot.proximity()}"
    yield f"ambient    {robot.ambient()}"
    yield from _tracking(rig)
    yield "watchdog   running" if rig.watchdog else "watchdog   none (virtual time)"
    if move:
        yield from _motion(rig)


def _trips(rig: Rig) -> list[float]:
    for _ in range(30):
        rig.robot.speeds()
    return rig.robot.round_trips[-30:]


def _tracking(rig: Rig) -> Iterator[str]:
    mover = rig.mover()
    seen = [mover.wait_for_sight()]
    begin = rig.clock.now()
    while len(seen) < PICTURES and rig.clock.now() - begin < 10:
        seen += mover.look()
        rig.clock.sleep(0.02)
    poses = np.array([s.pose for s in seen])
    spread = poses.std(0) * [1e3, 1e3, np.degrees(1)]
    rate = (len(seen) - 1) / max(seen[-1].time - seen[0].time, 1e-9)
    late = rig.clock.now() - seen[-1].time
    x, y, yaw = poses.mean(0)
    yield (
        f"tag        at {x:.3f}, {y:.3f} m, {np.degrees(yaw):.1f} deg; scatter "
        f"{max(spread[:2]):.2f} mm, {spread[2]:.2f} deg"
    )
    slow = "; TOO FEW: a moving robot must be seen every 0.15 s" * (rate < ENOUGH)
    yield f"camera     {rate:.1f} pictures a second, {late * 1e3:.0f} ms old{slow}"


def _motion(rig: Rig) -> Iterator[str]:
    """A short drive forward and back, compared with wheels and tag."""
    mover, robot = rig.mover(), rig.robot
    with rig.operator:
        stand = mover.wait_for_sight()
        before = robot.positions()
        mover.perform([Point(0.0, 0.06, 0.06, 0)], 1.5)
        after, seen = robot.positions(), mover.wait_for_sight()
        wheels = [
            robot.units.distance(b - a) for a, b in zip(before, after, strict=True)
        ]
        gone = seen.pose[:2] - stand.pose[:2]
        ahead = gone @ [np.cos(stand.pose[2]), np.sin(stand.pose[2])]
        yield (
            f"drive      wheels {wheels[0] * 1e3:.1f} and {wheels[1] * 1e3:.1f} mm, "
            f"tag {ahead * 1e3:.1f} mm ahead"
        )
        if ahead < 0.02:
            yield "drive      WRONG: the tag is turned, or the wheels are swapped"
        homing.go(mover, stand.pose)
        yield "drive      back where it was"
