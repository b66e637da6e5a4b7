"""Letting a controller steer a robot, cycle by cycle, with someone watching over it.

The trial's clock stands still while the robot is being turned at the edge: the cycle in
which it was stopped ends with it standing there, turned, as in the simulated worlds.
"""

from collections.abc import Sequence
from dataclasses import dataclass, field
from typing import NamedTuple

import numpy as np

from bns.hardware.driving import homing
from bns.hardware.driving.motion import Mover, Performed, Point
from bns.hardware.tracking.tracker import Sighting
from bns.worlds.active import Stages
from bns.worlds.light.closed_loop import LEAD, Call, Changes, Supervisor
from bns.worlds.light.sensors import LightSensors
from bns.worlds.physics import control
from bns.worlds.physics.session import LoopSignal
from bns.worlds.trial import Channel, Commands
from bns.worlds.world import Policy, checked_commands

LATE = 0.1  # s by which a command may be late before the trial is void; assumed
SEEN = 0.1  # s between two sights of a robot that is known to stand
APART = 0.002  # s between the last sight before a turn and the first after it


class Rules(NamedTuple):
    """What holds for a robot that steers itself.

    Attributes:
        supervisor: what happens at the lamp and at the edge.
        lamps: where the lamps are, ``(L, 2)`` [m].
        arena: size of the board [m].
        channels: what the robot is told.
        limits: largest magnitude of each, ``(C,)``.
        sensors: that it steers by.
    """

    supervisor: Supervisor
    lamps: np.ndarray
    arena: tuple[float, float]
    channels: Sequence[Channel]
    limits: np.ndarray
    sensors: LightSensors


@dataclass
class Steered(Performed):
    """What was carried out; all times are the trial's.

    Attributes:
        told: by the controller in each cycle, ``(C,)`` [m/s].
        readings: of each sensor, the start included, as the controller got them.
        handled: cycles in which the robot did not go by its own.
        turns, stops: at the edge and at a lamp.
        stopped: for good.
    """

    told: list[np.ndarray] = field(default_factory=list)
    readings: list[np.ndarray] = field(default_factory=list)
    handled: list[bool] = field(default_factory=list)
    turns: int = 0
    stops: int = 0
    stopped: bool = False


class Steering:
    """One trial of a robot that steers itself by its light sensors.

    Args:
        mover: of the robot.
        rules: what holds.
        cycles, cycle: how many commands, and how long each lasts [s].
        signal: what becomes of the commands.
        changes: what becomes of the readings.
        rng: of the headings after turns.
    """

    def __init__(
        self,
        mover: Mover,
        rules: Rules,
        *,
        cycles: int,
        cycle: float,
        signal: LoopSignal,
        changes: Changes,
        rng: np.random.Generator,
    ):
        self.mover, self.rules, self.rng = mover, rules, rng
        self.cycles, self.period = cycles, cycle
        self.signal, self.changes = signal, changes
        self.done = Steered()
        self._origin: float | None = None  # of the trial's clock
        self._fresh = Performed()  # sightings on the session's clock
        self._place = np.zeros(2)
        self._call: Call | None = None
        self._raw: list[tuple[int, ...]] = []

    def perform(self, policy: Policy) -> Steered:
        """Carry out a trial and stop.

        Args:
            policy: one controller.

        Raises:
            BnsError: the controller gives what the robot cannot be told.
            SafetyStop: it was stopped.
            Void: it was not carried out as told.
            LinkError: the line died.
        """
        done, memory = self.done, policy.memory(1)
        stand = self.mover.begin()
        self._place = stand.pose[:2]
        done.sightings.append(stand._replace(time=0.0))
        seen = self._read()
        try:
            for number in range(self.cycles):
                given, memory = policy.act(seen[None], memory)
                self._cycle(number, self._checked(given, number))
                if done.stopped:
                    break
                seen = self._read()
                self._flush((number + 1) * self.period)
            else:
                self._end()
        finally:
            self.mover.halt()
        self._wait()
        self.mover.judge(done, LATE)
        return done

    def _checked(self, given: object, number: int) -> np.ndarray:
        rules = self.rules
        return checked_commands(given, rules.channels, rules.limits, 1, number)[0]

    def _cycle(self, number: int, told: np.ndarray) -> None:
        """Drive by one command; whoever has to be is stopped, and turned."""
        done = self.done
        done.told.append(told)
        begin, end = number * self.period, (number + 1) * self.period
        for point in within(self.signal.cycle(told), begin, end, number):
            lead = self.mover.robot.lead(point.left, point.right)
            if self._origin is not None and self._called(point.at - lead):
                self._handle(number)
                return
            drive = self.mover.switch(point.left, point.right)
            if self._origin is None:  # it still stands where it stood
                self._origin = self.mover.begun(drive) - point.at
            done.late = max(done.late, abs(drive.at - self._origin - point.at))
            if point.command >= 0:
                done.switched.append(drive.at - self._origin)
        if self._called(end - LEAD):
            self._handle(number)
        else:
            done.handled.append(False)

    @property
    def _begun(self) -> float:
        """When the trial began [s]."""
        if self._origin is None:
            raise RuntimeError("The trial has not begun.")
        return self._origin

    def _called(self, moment: float) -> bool:
        """Tick until a moment of the trial; whether somebody has to step in."""
        return not self.mover.until(self._begun + moment, self._fresh, self._judged)

    def _judged(self, sighting: Sighting) -> bool:
        """Whether a robot at this place has to be stopped."""
        rules, before = self.rules, self._place
        self._place = sighting.pose[:2]
        ways = np.stack([before, self._place])[None]
        calls = rules.supervisor.calls(ways, rules.lamps, rules.arena)
        self._call = calls.get(0)
        return self._call is not None

    def _handle(self, number: int) -> None:
        """Stop the robot; turn it, or leave it where it stands."""
        mover, done, end = self.mover, self.done, (number + 1) * self.period
        mover.halt()
        stand = homing.settled(mover)
        if len(done.switched) < len(done.told):  # it had not been told yet
            done.switched.append(number * self.period)
        self._flush(end - 2 * APART)
        self._stands(stand, end - APART)
        done.handled.append(True)
        lamp, call = None, self._call
        if call is not None and call.reason == "lamp":
            lamp = self.rules.lamps[call.lamp]
            done.stops += 1
            done.stopped = self.rules.supervisor.at_lamp == "stop"
        else:
            done.turns += 1
        if not done.stopped:
            heading = self.rules.supervisor.heading(stand.pose[:2], lamp, self.rng)
            stand = homing.face(mover, heading)
        done.sightings.append(stand._replace(time=end))
        self._place, self._origin = stand.pose[:2], None

    def _read(self) -> np.ndarray:
        """The virtual sensors as the controller gets them, ``(2,)`` [counts]."""
        names = self.rules.sensors.names
        self._raw.append(self.mover.robot.ambient()[: len(names)])
        times = np.arange(len(self._raw)) * self.period
        seen = self.changes.last(times, np.array(self._raw, float), names)
        self.done.readings.append(seen)
        return self.rules.sensors.virtual(seen)

    def _end(self) -> None:
        """The last command is over."""
        total = self.cycles * self.period
        if self._origin is None:
            self.done.switched.append(total)
            return
        self.mover.until(
            self._origin + total - self.mover.robot.lead(0.0, 0.0),
            self._fresh,
            lambda seen: False,
        )
        drive = self.mover.drive(0.0, 0.0)
        self.done.switched.append(drive.at - self._origin)
        self.mover.halt()
        self.mover.look_on(self._fresh)
        self._flush(np.inf)

    def _wait(self) -> None:
        """A robot that was stopped stands until the trial is over; nobody waits."""
        done, left = self.done, self.cycles - len(self.done.told)
        if not done.stopped:
            return
        first = len(done.told)
        still = np.zeros_like(done.told[0])
        done.told += [still] * left
        done.handled += [True] * left
        done.readings += [done.readings[-1]] * (left + 1)
        done.switched += [(first + k) * self.period for k in range(left + 1)]
        self._stands(done.sightings[-1], self.cycles * self.period)

    def _stands(self, stand: Sighting, end: float) -> None:
        """It is seen where it stands, from now on until a moment of the trial."""
        seen = self.done.sightings
        times = [*np.arange(seen[-1].time + SEEN, end - SEEN / 2, SEEN), end]
        seen += [stand._replace(time=float(time)) for time in times]

    def _flush(self, until: float) -> None:
        """Put what was seen on the trial's clock, up to a moment of it."""
        if self._origin is None:
            return
        for sighting in self._fresh.sightings:
            time = sighting.time - self._origin
            if 0.0 < time < until:
                self.done.sightings.append(sighting._replace(time=time))
        self._fresh.sightings.clear()


GRID = 0.02  # s; effects are computed on it
SPACING = 0.1  # s between two set points within a command, at least
STEP = 0.002  # m/s; smaller changes are not sent


def points(commands: Commands, stages: Stages, seed: int, trial: int) -> list[Point]:
    """Set points of a trial.

    Args:
        commands: what the learner wants.
        stages: effects of the command and actuator stages act on it.
        seed, trial: of their generators.
    """
    counts = control.steps(commands.durations, GRID)
    signal = control.signal(commands, counts, GRID)
    values = control.disturbed(signal, stages.control, seed, trial)
    begins = np.concatenate([[0.0], np.cumsum(commands.durations)])
    parts = np.split(values, np.cumsum(counts)[:-1])
    spans = zip(parts, begins, begins[1:], strict=False)
    return [
        point
        for index, (part, begin, end) in enumerate(spans)
        for point in within(part, begin, end, index)
    ]


def within(values: np.ndarray, begin: float, end: float, command: int) -> list[Point]:
    """Set points of one command.

    Args:
        values: left and right on the grid, ``(S, 2)`` [m/s].
        begin, end: of the command [s].
        command: its index.
    """
    made = [Point(float(begin), float(values[0, 0]), float(values[0, 1]), command)]
    for step in range(1, len(values)):
        moment, new = begin + step * GRID, values[step]
        before = made[-1]
        far = max(abs(new[0] - before.left), abs(new[1] - before.right)) > STEP
        near_end = moment > end - SPACING
        if far and moment - before.at >= SPACING - 1e-9 and not near_end:
            made.append(Point(float(moment), float(new[0]), float(new[1]), -1))
    return made
