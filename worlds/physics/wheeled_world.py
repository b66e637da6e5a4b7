"""The physics world: robots in MuJoCo, each with its own damage, in batches."""

from collections.abc import Sequence
from typing import ClassVar, NamedTuple, Unpack

import numpy as np

from bns import models
from bns.errors import BnsError
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, of_kind, shared
from bns.worlds.damage import Damage
from bns.worlds.light.closed_loop import Sensing, Supervisor
from bns.worlds.physics import compile, control, observe
from bns.worlds.physics.rollout import Job, Motion, Pool
from bns.worlds.physics.session import Session, Setting
from bns.worlds.physics.world import PhysicsWorld, Settings
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial
from bns.worlds.world import CYCLE, CYCLES, Policy

STAGES = ("command", "actuator", "body", "tracking")


class Plan(NamedTuple):
    """One robot's trial before it is run."""

    commands: Commands
    stages: Stages
    seed: int
    counts: np.ndarray  # physics steps of each command, (K,)
    job: Job


class MujocoWorld(PhysicsWorld[Plan]):
    """Robots on wheels that execute commands in MuJoCo, N at a time.

    Args:
        robot: name of the robot model, see `bns robots`.
        name: of the world in the trials.
        settings: damage, reality, sample_dt, threads, start, arena, truth, see
            `Settings`.

    Raises:
        UnknownNameError: no such robot or effect.
        OutOfBoundsError: a number outside its bounds, a start outside the arena.
        BnsError: an effect that this robot or world cannot have.
    """

    stages: ClassVar[tuple[str, ...]] = STAGES

    def __init__(
        self,
        robot: str = "khepera3",
        *,
        name: str = "mujoco",
        **settings: Unpack[Settings],
    ):
        model = of_kind("wheeled", models.robot(robot))
        super().__init__(robot, model, name=name, **settings)
        self._limits = self.model.limits
        self._pool = Pool(self.threads)

    @property
    def dt(self) -> float:
        """Physics step [s]."""
        return float(compile.compiled(self.robot).model.opt.timestep)

    def motions(self, plans: Sequence[Plan]) -> list[Motion]:
        """What the physics makes of plans, see `PhysicsWorld.motions`."""
        return self._pool.map([plan.job for plan in plans])

    def _plan(self, commands: Commands, damage: Damage, trial: int, seed: int) -> Plan:
        dt = self.dt
        control.check(commands, self._channels, self._limits, self.robot)
        stages = self._stages(damage, trial, commands.duration)
        counts = control.steps(commands.durations, dt)
        if stages.control:
            given = control.signal(commands, counts, dt)
            values = control.disturbed(given, stages.control, seed, trial)
        else:
            values = np.repeat(commands.values, counts, axis=0)
        values = values * self.model.ctrl_per_command
        segments = compile.segments(self.robot, stages.body, values, dt)
        begin = compile.start_state(segments[0].compiled, self.start)
        return Plan(commands, stages, seed, counts, Job(begin, segments))

    def _stages(self, damage: Damage, trial: int, duration: float) -> Stages:
        """What holds for a robot in a trial."""
        return Stages.of(self.reality, damage, trial, duration)

    def _observe(self, plan: Plan, motion: Motion, trial: int) -> Trial:
        scene = plan.job.segments[0].compiled.model
        place = compile.free_joint(scene)
        free = motion.states[:, 1 + place.start : 1 + place.stop]
        sampled, boundaries, times, seen = self._watched(
            free, plan.counts, plan.stages, plan.seed, trial
        )
        return Trial(
            commands=plan.commands,
            times=times,
            observed=seen,
            boundaries=boundaries,
            outcome=observe.outcome(free, self.arena, motion.diverged >= 0),
            robot=self.robot,
            world=self.name,
            conditions=plan.stages.conditions(trial, plan.seed) | self._about(),
            truth=self.hidden(motion.states[sampled]) if self.truth else {},
        )

    def hidden(self, states: np.ndarray) -> dict[str, np.ndarray]:
        """Quantities by name from full physics states (time, qpos, qvel, ...)."""
        model = compile.compiled(self.robot).model
        end = 1 + model.nq
        return {"qpos": states[:, 1:end], "qvel": states[:, end : end + model.nv]}

    def drive(
        self,
        policy: Policy,
        *,
        cycles: int = CYCLES,
        cycle: float = CYCLE,
        trial: int = 0,
        seeds: Sequence[int] = (),
        starts: np.ndarray | None = None,
    ) -> list[Trial]:
        """Let N controllers drive N robots.

        Each cycle the sensors are read, the policy acts, its commands are held for a
        cycle. There are as many robots as starts, else as seeds, else as damages.

        Args:
            policy: the controllers, one a robot.
            cycles: commands of the trial.
            cycle: duration of each [s].
            trial: number of this trial, counted from 0.
            seeds: of what is random, one a robot; empty means 0, 1, 2, ...
            starts: poses in the world frame, shape ``(n, 3)`` [m, m, rad]; None =
                where this world's trials start.

        Returns:
            N trials, in order. Their commands are those sent; what was observed has
            the pose first and then the sensors, as read last.

        Raises:
            BnsError: numbers of robots disagree, a start or command that can not be.
        """
        if not self._robots(seeds, starts):
            return []
        session = self.session(
            cycles=cycles, cycle=cycle, trial=trial, seeds=seeds, starts=starts
        )
        memory = policy.memory(len(session.seeds))
        while session.cycle < cycles:
            commands, memory = policy.act(session.readings, memory)
            session.step(commands)
        return self.trials(session)

    def session(
        self,
        *,
        cycles: int = CYCLES,
        cycle: float = CYCLE,
        trial: int = 0,
        seeds: Sequence[int] = (),
        starts: np.ndarray | None = None,
    ) -> Session:
        """The same robots, to be told one command at a time; arguments as `drive`.

        Args:
            cycles: most commands of the session.
            cycle: duration of each [s].
            trial: number of this trial, counted from 0.
            seeds: of what is random, one a robot; empty means 0, 1, 2, ...
            starts: poses in the world frame, ``(n, 3)`` [m, m, rad]; None = where this
                world's trials start.

        Raises:
            BnsError: there is no robot; numbers of robots disagree; a start or a number
                of cycles that can not be.
        """
        n = self._robots(seeds, starts)
        if not n:
            raise BnsError("There is no robot: give a start or a seed at least.")
        damages, seeds = shared(self.damage, seeds, n)
        where = self._starts(n, seeds, trial) if starts is None else starts
        where = self._checked_starts(where, n)
        setting = Setting(
            robot=self.robot,
            channels=self._channels,
            limits=self._limits,
            ctrl_per_command=self.model.ctrl_per_command,
            dt=self.dt,
            cycle=cycle,
            cycles=int(bounded("cycles", cycles, 1, 1e6, "1")),
            trial=trial,
            arena=self.arena,
            pool=self._pool,
            supervisor=self._supervisor(),
            lamps=self._lamps(),
        )
        duration = setting.cycles * setting.steps * setting.dt
        stages = [self._stages(damage, trial, duration) for damage in damages]
        sensing = self._sensing(stages, seeds, trial, setting.cycles + 1)
        return Session(setting, stages, where, seeds, sensing)

    def _supervisor(self) -> Supervisor | None:
        """Who watches robots that steer themselves; None = nobody."""
        return None

    def _lamps(self) -> np.ndarray:
        """Where the lamps are, shape ``(L, 2)`` [m]."""
        return np.zeros((0, 2))

    def _sensing(
        self, stages: Sequence[Stages], seeds: Sequence[int], trial: int, reads: int
    ) -> Sensing | None:
        """What the robots see with; None = they have no sensors."""
        return None

    def _starts(self, n: int, seeds: Sequence[int], trial: int) -> np.ndarray:
        """Where trials start if nobody says, shape ``(n, 3)``."""
        return np.tile(self.start, (n, 1))

    def _checked_starts(self, starts: object, n: int) -> np.ndarray:
        poses = np.array(starts, dtype=np.float64)
        if poses.shape != (n, 3):
            raise BnsError(
                f"starts has shape {poses.shape} for {n} robots: give ({n}, 3), a "
                "pose (x, y, yaw) [m, m, rad] for each."
            )
        for pose in poses:
            checked_start(pose.tolist(), self.arena)
        return poses

    def _robots(self, seeds: Sequence[int], starts: np.ndarray | None) -> int:
        if starts is not None:
            return len(starts)
        if len(seeds):
            return len(seeds)
        return 1 if isinstance(self.damage, Damage) else len(self.damage)

    def trials(self, session: Session) -> list[Trial]:
        """The record of a session so far, a trial per robot."""
        steps, done = session.setting.steps, session.cycle
        counts = np.full(done, steps)
        every = max(self.sample_dt / self.dt, 1.0)
        sampled, boundaries = observe.sample_steps(counts, every)
        held = np.searchsorted(boundaries, np.arange(len(sampled)), side="right") - 1
        return [
            self._trial(session, robot, sampled, boundaries, held)
            for robot in range(len(session.seeds))
        ]

    def _trial(
        self,
        session: Session,
        robot: int,
        sampled: np.ndarray,
        boundaries: np.ndarray,
        held: np.ndarray,
    ) -> Trial:
        setting, stages = session.setting, session.stages[robot]
        states = session.states[robot, : session.cycle * setting.steps + 1]
        free = session.free(states)
        poses = observe.planar(free, session.starts[robot, 2])
        seed = session.seeds[robot]
        times, seen = observe.watched(
            poses,
            sampled,
            dt=setting.dt,
            effects=stages.tracking,
            seed=seed,
            trial=setting.trial,
        )
        channels: tuple[Channel, ...] = POSE_CHANNELS
        if session.sensing is not None:
            channels += session.sensing.channels
            seen = np.hstack([seen, session.sensing.readings[robot][held]])
        diverged = bool(session.diverged[robot])
        return Trial(
            commands=Commands(
                session.commands[robot, : session.cycle],
                np.full(session.cycle, setting.steps * setting.dt),
                setting.channels,
            ),
            times=times,
            observed=seen,
            boundaries=boundaries,
            channels=channels,
            outcome=observe.outcome(free, self.arena, diverged)._replace(
                stopped=bool(session.stopped[robot]),
                edge_turns=int(session.turns[robot]),
                lamp_stops=int(session.stops[robot]),
            ),
            robot=self.robot,
            world=self.name,
            conditions=stages.conditions(setting.trial, seed) | self._about(),
            truth=self.hidden(states[sampled]) if self.truth else {},
            handled=session.handled[robot, : session.cycle],
        )
