"""Carrying out commands on a robot, with an eye on all that can go wrong."""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from bns.errors import BnsError
from bns.hardware.clock import Clock
from bns.hardware.errors import LinkError, SafetyStop, Void
from bns.hardware.faults import FaultLog
from bns.hardware.khepera.driver import Drive, Khepera3
from bns.hardware.limits import Limits, Operator
from bns.hardware.tracking.eyes import Eyes
from bns.hardware.tracking.tracker import Sighting

TICK = 0.03  # s between two looks at everything
CHECK = 0.12  # s between two looks at the wheels' speeds
MEMORY = 0.7  # s for which an old set point may still show in the wheels' speeds
SLACK, SHARE = 900, 0.06  # speed units, share: what wheels may be off a set point
SETTLED = 0.6  # s after which a set point that was sent again shows in the speeds
ASTRAY = 0.015  # m that wrong or mistimed set points may lead a wheel astray
LATE = 0.25  # s by which a command may be late before the trial is void
AFTER = 0.25  # s of looking on after the last command


class Point(NamedTuple):
    """A set point of a schedule.

    Attributes:
        at: when, since the start [s].
        left, right: speeds over the floor [m/s].
        command: index of the command that begins here, -1 within one.
    """

    at: float
    left: float
    right: float
    command: int


@dataclass
class Performed:
    """What was carried out.

    Attributes:
        switched: when each command began, the end of the last one added [s].
        sightings: from before the start until after the end.
        late: by how much the latest set point was late [s].
        left: whether the robot came to the rim, which ended it.
        notes: what else there is to say.
    """

    switched: list[float] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    late: float = 0.0
    left: bool = False
    notes: list[str] = field(default_factory=list)


class Mover:
    """Drives a robot under the limits.

    Args:
        robot: identified, guarded.
        eyes: that see it.
        clock: of the session.
        limits: hold in every tick.
        operator: may stop it at any time.
        faults: where faults are noted.

    Attributes:
        last: newest sighting.
        points: set points of late.
        stubborn: a wheel was seen not to follow its set point.
    """

    def __init__(
        self,
        robot: Khepera3,
        eyes: Eyes,
        clock: Clock,
        *,
        limits: Limits,
        operator: Operator,
        faults: FaultLog,
    ):
        self.robot, self.eyes, self.clock = robot, eyes, clock
        self.limits, self.operator, self.faults = limits, operator, faults
        self.last: Sighting | None = None
        self.points: list[Drive] = []
        self._moving = self.stubborn = False

    def look(self) -> list[Sighting]:
        """New sightings; with the safety checks of a tick.

        Raises:
            SafetyStop: the operator, the camera or the tracker.
        """
        self.operator.check()
        try:
            seen = self.eyes.poll()
        except BnsError as error:
            raise SafetyStop(f"the camera is lost ({error})", "check it") from error
        if seen:
            self.last = seen[-1]
        now = self.clock.now()
        if self._moving and (
            self.last is None
            or now - self.last.time
            > self.limits.blind + self.eyes.tracker.camera.latency
        ):
            raise SafetyStop("the tracker has lost it", "free the view of its tag")
        if self._moving and self.robot.guard is not None:
            self.robot.guard.feed(moving=True)
        return seen

    def wait_for_sight(self, seconds: float = 3.0) -> Sighting:
        """A fresh sighting of the standing robot.

        Raises:
            BnsError: the tag is not in view.
        """
        begin = self.clock.now()
        while self.clock.now() - begin < seconds:
            for sighting in self.look():
                if sighting.time >= begin:
                    return sighting
            self.clock.sleep(TICK)
        raise BnsError(
            "The robot's tag is not in view: put the robot on the board, free the "
            "camera's view, light it evenly."
        )

    def drive(self, left: float, right: float, *, times: int = 2) -> Drive:
        """Set the speeds [m/s] and remember them."""
        self._moving = self._moving or bool(left or right)
        drive = self.robot.drive(left, right, times=times)
        self.points = self.points[-20:]
        self.points.append(drive)
        return drive

    def halt(self) -> None:
        """Stop the robot, whatever happened; a dead line is left to the watchdog."""
        try:
            self.robot.stop()
        except LinkError:
            self.faults.note("the stop was not confirmed", "D,l0,l0")
            raise
        finally:
            self._moving = False
            self.points.clear()

    def perform(self, schedule: Sequence[Point], total: float) -> Performed:
        """Carry out a schedule and stop.

        Args:
            schedule: set points in order of time, the first at 0.
            total: when the last one ends [s].

        Raises:
            SafetyStop: it was stopped.
            Void: it was not carried out as told.
            LinkError: the line died.
        """
        stand = self.wait_for_sight()
        done = Performed(sightings=[stand])
        self._wheels = _Wheels(self)
        try:
            begin = None
            for point in schedule:
                lead = self.robot.lead(point.left, point.right)
                if begin is not None and not self._until(begin + point.at - lead, done):
                    break
                drive = self.drive(point.left, point.right)
                self._wheels.switched(drive)
                if begin is None:  # it still stands where it stood
                    begin = drive.at
                    done.sightings.append(stand._replace(time=begin))
                done.late = max(done.late, abs(drive.at - begin - point.at))
                if point.command >= 0:
                    done.switched.append(drive.at)
            else:
                self._until(begin + total - self.robot.lead(0.0, 0.0), done)
            done.switched.append(self.drive(0.0, 0.0).at)
        finally:
            self.halt()
        self._look_on(done)
        self._judge(done)
        return done

    def _until(self, moment: float, done: Performed) -> bool:
        """Tick until a moment; whether the robot is still inside the rim."""
        while (left := moment - self.clock.now()) > 0.0005:
            for sighting in self.look():
                done.sightings.append(sighting)
                if self.limits.outside(sighting, self.limits.rim):
                    done.left = True
                    return False
            self._wheels.look(left)
            left = moment - self.clock.now()
            self.clock.sleep(min(TICK, max(left, 0.0)))
        return True

    def _look_on(self, done: Performed) -> None:
        until = self.clock.now() + AFTER
        while self.clock.now() < until:
            done.sightings += self.look()
            self.clock.sleep(TICK)

    def _judge(self, done: Performed) -> None:
        if done.late > LATE:
            raise Void(f"a command was {done.late:.2f} s late")
        if self._wheels.astray > ASTRAY:
            raise Void(f"set points led a wheel {self._wheels.astray:.3f} m astray")
        if self._wheels.stubborn:
            done.notes.append("a wheel does not follow its set point")


class _Wheels:
    """Whether the wheels do as they were told; a wrong set point is sent again.

    A digit that is lost on the line is acknowledged like any other number, so the
    speeds are read. What a wrong set point did until it was put right, and what a
    repeated one leaves open of its moment, is added up as a way that wheels were led
    astray. A wheel that stays off after the set point was sent again is like that: a
    damaged robot, and no fault of the line.
    """

    def __init__(self, mover: Mover):
        self.mover, self.astray, self.stubborn = mover, 0.0, mover.stubborn
        self._good = self._next = mover.clock.now()
        self._doubt = 0.0  # m that the fault in question led a wheel astray
        self._ignore = False
        self._units = (0, 0)

    def switched(self, drive: Drive) -> None:
        """A new set point holds."""
        if self._doubt and not self.stubborn:
            self.astray += self._doubt
        jump = max(abs(a - b) for a, b in zip(drive.units, self._units, strict=True))
        normal = 3 * min(self.mover.robot.round_trips[-20:])
        if drive.took > normal:  # repeated: either of them may have got through
            self.astray += drive.took / 2 * self._metres(jump)
        self._units, self._good = drive.units, drive.at
        self._ignore, self._doubt = False, 0.0
        self._next = drive.at + CHECK

    def _metres(self, units: float) -> float:
        return self.mover.robot.units.speed(units)

    def look(self, left: float) -> None:
        """Read the speeds where it is time and nothing else is due within 0.06 s."""
        now = self.mover.clock.now()
        if now < self._next or left < 0.06 or self._ignore:
            return
        self._next = now + CHECK
        off = self._off() and self._off()
        if not off:
            self.astray += self._doubt  # sending it again has helped: it was wrong
            self._doubt, self._good = 0.0, self.mover.clock.now()
        elif self._doubt:  # sending it again has not helped
            self._ignore = self.stubborn = self.mover.stubborn = True
            self._doubt = 0.0
        else:
            self._again(off)

    def _again(self, off: float) -> None:
        """Send the set point again; `off` is what the wheels are off it [units]."""
        mover, last = self.mover, self.mover.points[-1]
        mover.faults.note("wheels not as told", str(last.units), str(off))
        again = mover.robot.drive(*(self._metres(u) for u in last.units), times=2)
        # the wheels lag: until now they have shown about half of what is wrong
        self._doubt = 2 * self._metres(off) * (again.at - self._good)
        self._next = again.at + SETTLED

    def _off(self) -> float:
        """By how much a wheel is off its set points [units], 0 where it is not."""
        seen = self.mover.robot.speeds()
        now, points = self.mover.clock.now(), self.mover.points
        recent = [p.units for p in points if now - p.at < MEMORY]
        before = [p.units for p in points if now - p.at >= MEMORY][-1:] or [(0, 0)]
        worst = 0.0
        for side in (0, 1):
            told = [p[side] for p in (*before, *recent)]
            slack = SLACK + SHARE * max(map(abs, told))
            low, high = min(told) - slack, max(told) + slack
            worst = max(worst, low - seen[side], seen[side] - high)
        return worst
