"""Carrying out servo goals on a hexapod, frame by frame, with an eye on all there is.

A frame every 33 ms, as in the maker's firmware: the goals of all servos in one packet
(again, where they have not changed: a broadcast is not acknowledged), then the states
of a few servos in turn.
"""

import contextlib
from collections.abc import Iterator, Sequence
from dataclasses import dataclass, field

import numpy as np

from bns.errors import BnsError
from bns.hardware.clock import Clock
from bns.hardware.dynamixel.bus import Bus, Overload
from bns.hardware.faults import FaultLog
from bns.hardware.safety.limits import Limits, Operator, SafetyMonitor
from bns.hardware.tracking.eyes import Eyes
from bns.hardware.tracking.tracker import Sighting
from bns.models.ax12a import SPEED_UNIT

PERIOD = 0.033  # s; the maker's frame
LATE = 0.005  # s after its moment at which a frame is missed
READS = 4  # servos read in a frame
SPEED = round(300 * SPEED_UNIT, 4)  # rad/s; moving speed, as in the world 'hexapod'
SLOW = 0.8  # rad/s, for getting up
SETTLE = 0.1  # s after the servos should be there, until a first look at rest
STILL = 0.18  # s without a change: every servo was read once
LEAN = 0.13  # share by which the tag is smaller than at the stance: it leans by 45 deg
AFTER = 0.25  # s of looking on after the last command
FALLEN = 0.5  # s of leaning so far, after which it is taken for fallen
LIES = 5.0  # s for a robot without torque to come to rest


@dataclass
class Walked:
    """What was carried out.

    Attributes:
        switched: when each command began, the end of the last one added [s].
        sightings: from before the start on.
        readings: time [s] and joint angle [rad], by joint.
        frames: sent.
        missed: frames later than `LATE`.
        late: the latest [s].
        left: it came to the rim, which ended it.
        overloaded: a servo pushed in vain, which ended it.
        fell: it leant by 45 deg for a while, which ended it.
        unrested: a command ended by its time limit.
    """

    switched: list[float] = field(default_factory=list)
    sightings: list[Sighting] = field(default_factory=list)
    readings: dict[str, list[tuple[float, float]]] = field(default_factory=dict)
    frames: int = 0
    missed: int = 0
    late: float = 0.0
    left: bool = False
    overloaded: bool = False
    fell: bool = False
    unrested: bool = False


class Walker(SafetyMonitor):
    """Moves a hexapod under the limits.

    Args:
        bus: identified, guarded.
        eyes: that see it.
        clock: of the session.
        limits: hold in every frame.
        operator: may stop it at any time.
        faults: where faults are noted.

    Attributes:
        last: newest sighting.
        goals: in force [rad], by joint in the order of `names`.
        up: whether it stands on its legs, torque on.
    """

    def __init__(
        self,
        bus: Bus,
        eyes: Eyes,
        clock: Clock,
        *,
        limits: Limits,
        operator: Operator,
        faults: FaultLog,
        names: Sequence[str],
    ):
        super().__init__(eyes, clock, limits=limits, operator=operator, faults=faults)
        self.bus, self.names = bus, tuple(names)
        self.goals = np.zeros(len(self.names))
        self.up = False
        self._due = 0.0
        self._side = 0.0  # of the tag as seen at the stance [m]
        self._leans = np.inf  # s, since when it leans too far
        self._rest = Rest()

    def look(self, done: Walked | None = None) -> list[Sighting]:
        """New sightings, see `SafetyMonitor.look`."""
        seen = self._seen(moving=self.up)
        if seen:
            self._rest.pose(seen[-1].pose, self.clock.now())
        if done is not None:
            done.sightings += seen
            self._watch_leaning(seen, done)
        return seen

    def _watch_leaning(self, seen: list[Sighting], done: Walked) -> None:
        for sighting in seen:
            upright = sighting.side > self._side * (1 - LEAN)
            self._leans = np.inf if upright else min(self._leans, sighting.time)
            done.fell |= sighting.time - self._leans > FALLEN

    def tick(self) -> None:
        """Let the time between two looks pass; a robot on its legs goes on standing."""
        if self.up:
            self.frame()
        else:
            self.clock.sleep(PERIOD)

    def frame(self, done: Walked | None = None) -> None:
        """Wait for the next frame, send the goals, read some servos."""
        now = self.clock.now()
        if now > self._due + PERIOD:  # nothing was asked for in between
            self._due = now
        self.clock.sleep(self._due - now)
        late = self.clock.now() - self._due
        self._due += PERIOD
        self.bus.write(dict(zip(self.names, self.goals.tolist(), strict=True)))
        if done is not None:
            done.frames += 1
            done.missed += late > LATE
            done.late = max(done.late, late)
        self.bus.powered()
        for joint, state in self.bus.look(READS):
            at, angle = self.clock.now(), joint.angle(state.position)
            self._rest.servo(joint.id, state.position, at)
            if done is not None:
                done.readings.setdefault(joint.name, []).append((at, angle))

    def rise(self) -> None:
        """Switch the torque on where the legs are, then stand, slowly."""
        if self.up:
            return
        self.wait_for_sight()
        present = self._lying()
        self.goals = np.array([present[name] for name in self.names])
        with self._or_halt():
            self.bus.pace(SLOW)
            self.bus.write(present)
            self.bus.power()
            self.up = True
            self.go(np.zeros(len(self.names)), 8.0, speed=SLOW)
            self.bus.pace(SPEED)
            self._side = self.wait_for_sight().side

    def _lying(self) -> dict[str, float]:
        """Angles [rad] of the joints, by name, once neither they nor the tag move.

        A robot whose torque went off sinks for a while: torque in the midst of that
        would catch it in a stance that nobody chose, and it would not have stopped.

        Raises:
            BnsError: it does not come to rest.
        """
        begin = self.clock.now()
        self._rest.again(begin)
        while self.clock.now() - begin < LIES:
            found = {}
            for joint in self.bus.joints:
                units = self.bus.read(joint.id).position
                self._rest.servo(joint.id, units, self.clock.now())
                found[joint.name] = joint.angle(units)
            self.look()
            if self.clock.now() - self._rest.since >= STILL:
                return found
            self.clock.sleep(PERIOD)
        raise BnsError(
            "The robot moves though its servos have no torque: put it on the board and "
            "let go of it."
        )

    def halt(self) -> None:
        """Torque off, whatever happened."""
        self.up = False
        self.bus.stop()

    @contextlib.contextmanager
    def _or_halt(self) -> Iterator[None]:
        """Torque off where what is done here fails, in whatever way."""
        with contextlib.ExitStack() as failed:
            failed.callback(self.halt)
            yield
            failed.pop_all()

    def rest(self) -> None:
        """It stands, and goes on standing while nobody sends anything."""
        if self.up and self.bus.guard is not None:
            self.bus.guard.feed(moving=False)

    def go(
        self,
        goals: np.ndarray,
        limit: float,
        done: Walked | None = None,
        *,
        speed: float = SPEED,
        wait: bool = True,
    ) -> bool:
        """Send goals until the robot rests; whether it does.

        Args:
            goals: of all servos [rad], ``(18,)``.
            limit: longest time [s].
            done: takes what is seen; its `left` or `fell` ends it, too.
            speed: of the servos [rad/s].
            wait: for rest; else the time that the servos need by themselves.
        """
        begin = self.clock.now()
        ready = begin + float(np.abs(goals - self.goals).max()) / speed + SETTLE
        self.goals = np.array(goals, float)
        self._rest.again(begin)
        while self.clock.now() - begin < limit:
            self.frame(done)
            for sighting in self.look(done):
                if done is not None and self.limits.outside(sighting, self.limits.rim):
                    done.left = True
            if done is not None and (done.left or done.fell):
                return False
            now = self.clock.now()
            if now >= ready and (not wait or now - self._rest.since >= STILL):
                return True
        return False

    def perform(self, goals: np.ndarray, limits: Sequence[float]) -> Walked:
        """Carry out commands; it stands in the last one afterwards.

        Args:
            goals: ``(K, 18)`` [rad].
            limits: longest time of each [s].

        Raises:
            SafetyStop: it was stopped, torque is off.
            Void: it was not carried out as told, torque is off.
            LinkError: the line died.
        """
        done = Walked(sightings=[self.wait_for_sight()])
        with self._or_halt():
            try:
                for _ in range(-(-len(self.names) // READS)):  # every servo once
                    self.frame(done)
                    self.look(done)
                for row, limit in zip(goals, limits, strict=True):
                    done.switched.append(self.clock.now())
                    rests = self.go(row, float(limit), done)
                    if done.left or done.fell:
                        break
                    done.unrested |= not rests
                self._end(done)
            except Overload:
                done.overloaded = True
                self._end(done)
        return done

    def _end(self, done: Walked) -> None:
        """Stay, and look on."""
        now = self.clock.now()
        done.switched.append(now)
        while self.clock.now() < now + AFTER:
            with contextlib.suppress(Overload):
                self.frame()
            self.look(done)


UNITS, MOVED, TURNED = 2, 0.002, np.deg2rad(0.5)
"""changes that count as motion: of a servo [units], of the robot [m], [rad]"""


class Rest:
    """Since when nothing has moved.

    Attributes:
        since: time of the newest change [s].
    """

    def __init__(self) -> None:
        self.since = 0.0
        self._units: dict[int, int] = {}
        self._pose = np.full(3, np.inf)

    def again(self, now: float) -> None:
        """A new goal: motion is to be expected."""
        self.since = now

    def servo(self, number: int, units: int, now: float) -> None:
        """A servo's position was read.

        Args:
            number: of the servo.
            units: its position [position units].
            now: time of the reading [s].
        """
        if abs(units - self._units.get(number, -9)) > UNITS:
            self._units[number], self.since = units, now

    def pose(self, pose: np.ndarray, now: float) -> None:
        """The robot was seen: x, y [m] and yaw [rad], at a time [s]."""
        off = np.abs(pose - self._pose)
        if np.hypot(*off[:2]) > MOVED or off[2] > TURNED:
            self._pose, self.since = pose, now
