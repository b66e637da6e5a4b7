"""N robots that are told one command at a time: `Session`."""

from collections.abc import Sequence
from dataclasses import dataclass, field

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.worlds import closed_loop, compile, observe
from bns.worlds.active import Stages
from bns.worlds.checks import bounded
from bns.worlds.loop_control import LoopControl
from bns.worlds.physics import Job, Motion, Pool
from bns.worlds.sensing import LEAD, Sensing
from bns.worlds.supervisor import PERIOD, Call, Supervisor
from bns.worlds.trial import Channel


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

    def __post_init__(self):
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
        stages: what holds for each of them in this trial.
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
        size = len(begin[0]) if n else 0
        self.states = np.empty((n, cycles * steps + 1, size))
        if n:
            self.states[:, 0] = begin
        self._place = compile.free_joint(self._controls[0].first.model) if n else None
        self._warm: list[np.ndarray | None] = [None] * n
        self._turning = {}
        self.commands = np.zeros((n, cycles, len(setting.channels)))
        self.handled = np.zeros((n, cycles), bool)
        self.turns, self.stops = np.zeros(n, int), np.zeros(n, int)
        self.stopped, self.diverged = np.zeros(n, bool), np.zeros(n, bool)
        self.cycle = 0
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
        told = closed_loop.checked(commands, setting.channels, setting.limits, n, at)
        told[self.stopped | self.diverged] = 0.0
        self.commands[:, at] = told
        begin = at * self.setting.steps
        jobs = {
            robot: Job(
                self.states[robot, begin],
                self._controls[robot].standing(begin, begin + setting.steps)
                if self.stopped[robot]
                else self._controls[robot].cycle(told[robot]),
                self._warm[robot],
            )
            for robot in range(n)
            if not self.diverged[robot]
        }
        motions = setting.pool.map(list(jobs.values()))
        for robot, motion in zip(jobs, motions, strict=True):
            self._keep(robot, begin, motion)
        self.states[self.diverged, begin + 1 : begin + setting.steps + 1] = np.nan
        self.cycle = at + 1
        moved = self._supervise(begin)
        self.readings = self._read(moved)
        return self.readings

    def _keep(self, robot: int, begin: int, motion: Motion) -> None:
        end = begin + len(motion.states)
        self.states[robot, begin:end] = motion.states
        self._warm[robot] = motion.warm
        self.diverged[robot] |= motion.diverged >= 0

    def _supervise(self, begin: int) -> np.ndarray:
        """Stop and turn who has to be; which of the robots were put somewhere."""
        setting, moved = self.setting, np.zeros(len(self.stages), bool)
        self.handled[:, self.cycle - 1] = self.stopped
        if setting.supervisor is None or not len(self.stages):
            return moved
        every = max(round(PERIOD / setting.dt), 1)
        looks = np.append(np.arange(0, setting.steps, every), setting.steps)
        places = self.states[:, begin + looks, 1:3]
        calls = setting.supervisor.calls(places, setting.lamps, setting.arena)
        for robot, call in calls.items():
            if not self.stopped[robot]:
                self._handle(robot, begin, int(looks[call.look]), call)
                moved[robot] = not self.stopped[robot]
        return moved

    def _handle(self, robot: int, begin: int, look: int, call: Call) -> None:
        """Stop a robot in mid-cycle; at the cycle's end it is turned or left there."""
        end = begin + self.setting.steps
        self.handled[robot, self.cycle - 1] = True
        if begin + look < end:
            standing = self._controls[robot].standing(begin + look, end)
            job = Job(self.states[robot, begin + look], standing)
            self._keep(robot, begin + look, self.setting.pool.map([job])[0])
        supervisor = self.setting.supervisor
        if call.reason == "lamp":
            self.stops[robot] += 1
            self.stopped[robot] = supervisor.at_lamp == "stop"
        else:
            self.turns[robot] += 1
        if self.stopped[robot] or self.diverged[robot]:
            return
        lamp = self.setting.lamps[call.lamp] if call.reason == "lamp" else None
        state = self.states[robot, end]
        yaw = supervisor.heading(state[1:3], lamp, self._turner(robot))
        model = self._controls[robot].first.model
        self.states[robot, end] = compile.turned(model, state, yaw)
        self._warm[robot] = None

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
        place = self._place or slice(0, 7)
        return states[..., 1 + place.start : 1 + place.stop]
