"""N robots that are told one command at a time, and what each does in a cycle."""

import math
from collections.abc import Sequence
from dataclasses import dataclass, field, replace
from itertools import pairwise

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.worlds.active import Placed, Stages
from bns.worlds.checks import bounded
from bns.worlds.effects.base import ControlSignal
from bns.worlds.light.closed_loop import LEAD, PERIOD, Call, Sensing, Supervisor
from bns.worlds.physics import compile, observe
from bns.worlds.physics.rollout import Compiled, Job, Motion, Pool, Segment
from bns.worlds.trial import Channel
from bns.worlds.world import checked_commands


class LoopSignal:
    """The commands of one robot, as they come, after the effects on them.

    Args:
        effects: of the command and actuator stages, with when they hold.
        steps: of a cycle.
        cycles: of the trial.
        dt: step [s].
        channels: what the robot is told.
        seed, trial: of what is random.
    """

    def __init__(
        self,
        effects: Sequence[Placed],
        *,
        steps: int,
        cycles: int,
        dt: float,
        channels: tuple[str, ...],
        seed: int,
        trial: int,
    ):
        self._steps, self._dt, self._channels = steps, dt, channels
        self._effects = [
            (item, rng, rng.bit_generator.state)
            for item in effects
            for rng in [item.generator(seed, trial)]
        ]
        self._told, self._count = np.empty((cycles, len(channels))), 0
        self._memoryless = all(
            getattr(item.effect, "memoryless", False) for item in effects
        )

    def __bool__(self) -> bool:
        return bool(self._effects)

    def cycle(self, told: np.ndarray) -> np.ndarray:
        """The next command, ``(C,)``, at each step of its cycle, ``(steps, C)``."""
        self._told[self._count] = told
        self._count += 1
        count = self._count
        first = count - 1 if self._memoryless else 0
        command = np.repeat(np.arange(first, count), self._steps)
        given = ControlSignal(
            times=np.arange(first * self._steps, count * self._steps) * self._dt,
            values=self._told[command],
            command=command,
            channels=self._channels,
            dt=self._dt,
        )
        for item, rng, begin in self._effects:
            rng.bit_generator.state = begin
            values = item.effect.apply(given, item.active(given.times), rng)
            given = replace(given, values=values)
        return given.values[-self._steps :]


class LoopControl:
    """From the commands of one robot, as they come, to segments of its motion.

    Args:
        robot: name of the robot model.
        stages: what holds in this trial.
        steps: physics steps of a cycle.
        cycles: of the trial.
        dt: physics step [s].
        channels: what the robot is told.
        ctrl_per_command: see `RobotModel`.
        seed, trial: of what is random.
    """

    def __init__(
        self,
        robot: str,
        stages: Stages,
        *,
        steps: int,
        cycles: int,
        dt: float,
        channels: tuple[str, ...],
        ctrl_per_command: float,
        seed: int,
        trial: int,
    ):
        self._steps, self._scale, self._count = steps, ctrl_per_command, 0
        self._signal = LoopSignal(
            stages.control,
            steps=steps,
            cycles=cycles,
            dt=dt,
            channels=channels,
            seed=seed,
            trial=trial,
        )
        blank = np.zeros((steps * cycles, 0))
        pieces = compile.segments(robot, stages.body, blank, dt)
        ends = np.cumsum([0, *(len(piece.control) for piece in pieces)]).tolist()
        self._pieces: list[tuple[int, int, Compiled]] = [
            (begin, end, piece.compiled)
            for (begin, end), piece in zip(pairwise(ends), pieces, strict=True)
        ]

    @property
    def first(self) -> Compiled:
        """The model that the trial starts with."""
        return self._pieces[0][2]

    def cycle(self, held: np.ndarray, controls: np.ndarray) -> tuple[Segment, ...]:
        """The next cycle's motion.

        Args:
            held: the command at each physics step of the cycle, ``(steps, C)``.
            controls: of the actuators if nothing changes it, ``(steps, nu)``.
        """
        begin = self._count * self._steps
        self._count += 1
        if self._signal:
            controls = self._signal.cycle(held[0]) * self._scale
        if len(self._pieces) == 1:
            return (Segment(self._pieces[0][2], controls),)
        end = begin + self._steps
        return tuple(
            Segment(model, controls[max(a, begin) - begin : min(b, end) - begin])
            for a, b, model in self._pieces
            if a < end and b > begin
        )


@dataclass(frozen=True, eq=False)
class Setting:
    """What all robots of a session share.

    Attributes:
        robot: name of the robot model.
        channels: what it is told.
        limits: largest magnitude of each command, shape ``(C,)``.
        ctrl_per_command: see `RobotModel`.
        dt: physics step [s].
        cycle: duration of a command [s].
        cycles: commands at most.
        trial: number of the trial.
        arena: size of the board [m].
        pool: of the physics.
        supervisor: who watches; None = nobody.
        lamps: where the lamps are, ``(L, 2)`` [m], for the supervisor.
    """

    robot: str
    channels: tuple[Channel, ...]
    limits: np.ndarray
    ctrl_per_command: float
    dt: float
    cycle: float
    cycles: int
    trial: int
    arena: tuple[float, float]
    pool: Pool
    supervisor: Supervisor | None = None
    lamps: np.ndarray = field(default_factory=lambda: np.zeros((0, 2)))

    def __post_init__(self) -> None:
        bounded("cycle", self.cycle, self.dt, 60.0, "s")
        bounded("cycles", self.cycles, 1, 1e6, "1")

    @property
    def steps(self) -> int:
        """Physics steps of a cycle."""
        return max(round(self.cycle / self.dt), 1)


class Session:
    """N robots in closed loop, each from its own state, cycle by cycle.

    Args:
        setting: what they share.
        stages: what holds for each of them in this trial; one at least.
        starts: poses, shape ``(n, 3)`` [m, m, rad].
        seeds: of each.
        sensing: their sensors; None = they have none.

    Attributes:
        states: full physics states on the physics grid, ``(n, S + 1, nstate)``, filled
            as far as the session is; NaN from where a robot diverged.
        commands: as sent, shape ``(n, cycles, C)``.
        handled: robots that did not go by their own, ``(n, cycles)``.
        turns, stops: at the edge and at a lamp, ``(n,)``.
        stopped: for good, ``(n,)``.
        cycle: cycles done.
        segments: of the motion in the last cycle, of the robots that moved.
        readings: of the sensors now, ``(n, S)`` [counts]; S is 0 without sensors.
    """

    def __init__(
        self,
        setting: Setting,
        stages: Sequence[Stages],
        starts: np.ndarray,
        seeds: Sequence[int],
        sensing: Sensing | None = None,
    ):
        self.setting, self.stages, self.seeds = setting, stages, seeds
        self.starts, self.sensing = starts, sensing
        n, steps, cycles = len(stages), setting.steps, setting.cycles
        self._controls = [
            LoopControl(
                setting.robot,
                item,
                steps=steps,
                cycles=cycles,
                dt=setting.dt,
                channels=tuple(channel.name for channel in setting.channels),
                ctrl_per_command=setting.ctrl_per_command,
                seed=seed,
                trial=setting.trial,
            )
            for item, seed in zip(stages, seeds, strict=True)
        ]
        begin = [
            compile.start_state(item.first, tuple(start.tolist()))
            for item, start in zip(self._controls, starts, strict=True)
        ]
        self.states = np.empty((n, cycles * steps + 1, len(begin[0])))
        self.states[:, 0] = begin
        self._free, self._speeds = _columns(self._controls)
        every = max(round(PERIOD / setting.dt), 1)
        self._looks = np.append(np.arange(0, steps, every), steps)
        self._warm: list[np.ndarray | None] = [None] * n
        self._turning: dict[int, np.random.Generator] = {}
        self.commands = np.zeros((n, cycles, len(setting.channels)))
        self.handled = np.zeros((n, cycles), bool)
        self.turns, self.stops = np.zeros(n, int), np.zeros(n, int)
        self.stopped, self.diverged = np.zeros(n, bool), np.zeros(n, bool)
        self.cycle = 0
        self.segments: dict[int, tuple[Segment, ...]] = {}
        self.readings = self._read(np.ones(n, bool))

    def step(self, commands: object) -> np.ndarray:
        """Let every robot do its command for one cycle.

        Args:
            commands: shape ``(n, C)``, SI units.

        Returns:
            The readings afterwards, ``(n, S)``.

        Raises:
            BnsError: no finite numbers, another shape.
            OutOfBoundsError: beyond the robot's limits.
        """
        n, at = len(self.stages), self.cycle
        setting = self.setting
        if at >= setting.cycles:
            raise BnsError(
                f"The {setting.cycles} cycles of this trial are over; begin another."
            )
        told = checked_commands(commands, setting.channels, setting.limits, n, at)
        told[self.stopped | self.diverged] = 0.0
        self.commands[:, at] = told
        begin = at * self.setting.steps
        live = np.flatnonzero(~(self.stopped | self.diverged)).tolist()
        held = np.repeat(told[:, None], setting.steps, axis=1)
        controls = held * setting.ctrl_per_command
        self.segments = {
            robot: self._controls[robot].cycle(held[robot], controls[robot])
            for robot in live
        }
        jobs = [
            Job(
                self.states[robot, begin],
                self.segments[robot],
                self._warm[robot],
                self.states[robot, begin : begin + setting.steps + 1],
            )
            for robot in live
        ]
        for robot, motion in zip(live, setting.pool.map(jobs), strict=True):
            self._keep(robot, motion)
        for robot in set(range(n)) - set(live):
            self._still(robot, begin)
        self.cycle = at + 1
        moved = self._supervise(begin)
        self.readings = self._read(moved)
        return self.readings

    def _keep(self, robot: int, motion: Motion) -> None:
        self._warm[robot] = motion.warm
        self.diverged[robot] |= motion.diverged >= 0

    def _still(self, robot: int, begin: int) -> None:
        """A cycle of a robot that was stopped, or that the physics has lost."""
        span = slice(begin + 1, begin + self.setting.steps + 1)
        self.states[robot, span] = self.states[robot, begin]
        self.states[robot, span, 0] += (
            np.arange(1, self.setting.steps + 1) * self.setting.dt
        )

    def _supervise(self, begin: int) -> np.ndarray:
        """Stop and turn who has to be; which of the robots were put somewhere."""
        setting, moved = self.setting, np.zeros(len(self.stages), bool)
        self.handled[:, self.cycle - 1] = self.stopped
        if setting.supervisor is None:
            return moved
        places = self.states[:, begin + self._looks, 1:3]
        calls = setting.supervisor.calls(places, setting.lamps, setting.arena)
        for robot, call in calls.items():
            if not self.stopped[robot]:
                self._hold(robot, begin + self._looks[call.look])
                self._handle(robot, call, setting.supervisor)
                moved[robot] = not self.stopped[robot]
        return moved

    def _hold(self, robot: int, step: int) -> None:
        """A robot stands from a physics step to the end of the cycle."""
        states = self.states[robot, step : self.cycle * self.setting.steps + 1]
        states[:, 1:] = states[0, 1:]
        states[:, self._speeds] = 0.0
        self._warm[robot] = None

    def _handle(self, robot: int, call: Call, supervisor: Supervisor) -> None:
        """A robot that was stopped is turned, or left where it stands."""
        self.handled[robot, self.cycle - 1] = True
        lamp = None
        if call.reason == "lamp":
            lamp = self.setting.lamps[call.lamp]
            self.stops[robot] += 1
            self.stopped[robot] = supervisor.at_lamp == "stop"
        else:
            self.turns[robot] += 1
        if not (self.stopped[robot] or self.diverged[robot]):
            free = self.free(self.states[robot, self.cycle * self.setting.steps])
            yaw = supervisor.heading(free[:2], lamp, self._turner(robot))
            free[3:] = _turned(free[3:].tolist(), yaw)

    def _turner(self, robot: int) -> np.random.Generator:
        if robot not in self._turning:
            self._turning[robot] = seeding.generator(
                self.seeds[robot], "world", self.setting.trial, "turns"
            )
        return self._turning[robot]

    def _read(self, moved: np.ndarray) -> np.ndarray:
        """Readings at the end of a cycle; of robots put somewhere, from there."""
        if self.sensing is None:
            return np.zeros((len(self.stages), 0))
        dt, now = self.setting.dt, self.cycle * self.setting.steps
        lead = 0 if now == 0 else min(round(LEAD / dt), self.setting.steps)
        taken = now - np.where(moved, 0, lead)
        poses = observe.flat(self.free(self.states[np.arange(len(moved)), taken]))
        return self.sensing.read(now * dt, poses, taken * dt)

    def free(self, states: np.ndarray) -> np.ndarray:
        """Position and orientation of the robots' bodies, ``(..., 7)``, from states."""
        return states[..., self._free]


def _turned(quaternion: Sequence[float], yaw: float) -> tuple[float, ...]:
    """An orientation (w, x, y, z) turned to a yaw [rad], its tilt kept."""
    w, x, y, z = quaternion
    angle = yaw - math.atan2(2 * (w * z + x * y), 1 - 2 * (y * y + z * z))
    cos, sin = math.cos(angle / 2), math.sin(angle / 2)
    return (
        cos * w - sin * z,
        cos * x - sin * y,
        cos * y + sin * x,
        cos * z + sin * w,
    )


def _columns(controls: Sequence[LoopControl]) -> tuple[slice, slice]:
    """Where a full physics state has the base's pose, and where all speeds."""
    model = controls[0].first.model
    place = compile.free_joint(model)
    speeds = slice(1 + model.nq, 1 + model.nq + model.nv)
    return slice(1 + place.start, 1 + place.stop), speeds
