"""Carrying out commands on a robot, with an eye on all that can go wrong."""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

from bns.hardware.clock import Clock
from bns.hardware.driving.wheels import Following, Wheels
from bns.hardware.faults import FaultLog, LinkError, Void
from bns.hardware.khepera.driver import Drive, Khepera3
from bns.hardware.safety.limits import Limits, Operator, SafetyMonitor
from bns.hardware.safety.motion_check import MotionCheck
from bns.hardware.tracking.eyes import Eyes
from bns.hardware.tracking.tracker import Sighting

TICK = 0.02  # s between two looks at everything
ASTRAY = 0.018  # m that a wrong or mistimed set point may lead a wheel astray
UNSEEN = 0.002  # m that a wheel may have moved before its trial began; assumed
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


class Mover(SafetyMonitor):
    """Drives a robot under the limits.

    Args:
        robot: identified, guarded.
        eyes: that see it.
        clock: of the session.
        limits: hold in every tick.
        operator: may stop it at any time.
        faults: where faults are noted.
        following: what is known of the wheels already.

    Attributes:
        last: newest sighting.
        points: set points of late.
        following: how the wheels follow.
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
        following: Following | None = None,
    ):
        super().__init__(eyes, clock, limits=limits, operator=operator, faults=faults)
        self.robot, self.following = robot, following or Following()
        self.points: list[Drive] = []
        self._moving = False
        self._check = MotionCheck()

    def look(self) -> list[Sighting]:
        """New sightings, see `SafetyMonitor.look`; feeds the watchdog."""
        seen = self._seen(moving=self._moving)
        for sighting in seen:
            stands = self._check.stands(sighting, self.following.shares)
            if stands and self._moving:
                self._unmoved()
        if self._moving:
            self.robot.alive()
        return seen

    def tick(self) -> None:
        """Let the time between two looks pass."""
        self.clock.sleep(TICK)

    def drive(self, left: float, right: float, *, times: int = 2) -> Drive:
        """Set the speeds and remember them.

        Args:
            left, right: of the wheels over the floor [m/s].
            times: how often they are sent, see `Khepera3.drive`.
        """
        self._moving = self._moving or bool(left or right)
        drive = self.robot.drive(left, right, times=times)
        self._check.told(drive.at, left, right)
        self.points = self.points[-20:]
        self.points.append(drive)
        return drive

    def _unmoved(self) -> None:
        """Stop a robot that is seen to stand; where it does stand, let it try on.

        Raises:
            Void: its wheels turn, so that the picture does not show it as it is.
        """
        if self.robot.paused():
            self.faults.note("seen to stand", "tag", "wheels turn")
            raise Void(
                "it drives and the picture does not change",
                "see that the camera works, then go on with --resume",
            )
        self.faults.note("stands", "told to move", str(self.points[-1].units))
        units, robot = self.points[-1].units, self.robot
        speeds = map(robot.speed, units)
        self.drive(*(v * f for v, f in zip(speeds, robot.wheels, strict=True)))
        self._check.excuse()

    def halt(self) -> None:
        """Stop the robot, whatever happened; a dead line is left to the watchdog."""
        self._check.told(self.clock.now(), 0.0, 0.0)  # from then on it need not move
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
        stand = self.begin()
        done = Performed(sightings=[stand])
        try:
            begin: float | None = None
            for point in schedule:
                lead = self.robot.lead(point.left, point.right)
                if begin is not None and not self._inside(
                    begin + point.at - lead, done
                ):
                    break
                drive = self.switch(point.left, point.right)
                if begin is None:  # it still stands where it stood
                    begin = self.begun(drive)
                    done.sightings.append(stand._replace(time=begin))
                done.late = max(done.late, abs(drive.at - begin - point.at))
                if point.command >= 0:
                    done.switched.append(drive.at)
            else:
                begin = self.clock.now() if begin is None else begin
                self._inside(begin + total - self.robot.lead(0.0, 0.0), done)
            done.switched.append(self.drive(0.0, 0.0).at)
        finally:
            self.halt()
        self.look_on(done)
        self.judge(done)
        return done

    def begin(self) -> Sighting:
        """See the standing robot before it carries something out.

        Raises:
            BnsError: the tag is not in view.
        """
        stand = self.wait_for_sight()
        self._wheels = Wheels(self)
        return stand

    def doubt(self, drive: Drive) -> float:
        """By how much it is not known when a set point held [s]: one that had to be
        sent again may have got through before."""
        usual = 3 * min(self.robot.round_trips[-20:])
        return drive.took / 2 if drive.took > usual else 0.0

    def begun(self, drive: Drive) -> float:
        """When the first set point of a trial held [s].

        Raises:
            Void: it had to be sent again, and a wheel may have moved before.
        """
        fastest = max(abs(self.robot.speed(units)) for units in drive.units)
        if (way := self.doubt(drive) * fastest) > UNSEEN:
            raise Void(
                "the first command had to be sent again: a wheel may have moved "
                f"{1e3 * way:.0f} mm before"
            )
        return drive.at

    def switch(self, left: float, right: float) -> Drive:
        """As `drive`, within what is carried out: the wheels are then watched."""
        drive = self.drive(left, right)
        self._wheels.switched(drive)
        return drive

    def until(
        self, moment: float, done: Performed, ends: Callable[[Sighting], bool]
    ) -> bool:
        """Tick until a moment, or a sighting that ends it; whether none did.

        Args:
            moment: on the session's clock [s].
            done: takes the sightings.
            ends: whether a sighting ends it.
        """
        while (left := moment - self.clock.now()) > 0.0005:
            for sighting in self.look():
                done.sightings.append(sighting)
                if ends(sighting):
                    return False
            begin = self.clock.now()
            self._wheels.look(left)
            now = self.clock.now()
            self.clock.sleep(
                min(max(TICK - (now - begin), 0.0), max(moment - now, 0.0))
            )
        return True

    def _inside(self, moment: float, done: Performed) -> bool:
        """Tick until a moment; whether the robot is still inside the rim."""
        done.left = not self.until(
            moment, done, lambda seen: self.limits.outside(seen, self.limits.rim)
        )
        return not done.left

    def look_on(self, done: Performed) -> None:
        """See where the robot comes to rest."""
        until = self.clock.now() + AFTER
        while self.clock.now() < until:
            done.sightings += self.look()
            self.tick()

    def judge(self, done: Performed, late: float = LATE) -> None:
        """Refuse what was not carried out as told.

        Args:
            done: what was carried out.
            late: by which a command may be late [s].

        Raises:
            Void: it was not carried out as told.
        """
        if done.late > late:
            raise Void(f"a command was {done.late:.2f} s late")
        if (way := self._wheels.end()) > ASTRAY:
            raise Void(f"a set point led a wheel {way:.3f} m astray")
        if self._wheels.odd:
            done.notes.append("a wheel does not follow its set point")
