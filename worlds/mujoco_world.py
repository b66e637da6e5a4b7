"""The physics world: robots in MuJoCo, each with its own damage, in batches."""

from collections.abc import Sequence
from typing import NamedTuple

import mujoco
import numpy as np

from bns import models
from bns.worlds import active, compile, control, observe
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.loops import Loops
from bns.worlds.physics import Job, Motion, Pool
from bns.worlds.trial import Commands, Trial

STAGES = ("command", "actuator", "body", "tracking")


class Plan(NamedTuple):
    """One robot's trial before it is run."""

    commands: Commands
    stages: Stages
    seed: int
    counts: np.ndarray  # physics steps of each command, (K,)
    job: Job


class MujocoWorld(Loops):
    """Robots that execute commands in MuJoCo, N at a time.

    A trial depends on its commands, damage, trial number and seed alone: not on the
    other robots of the batch, their order, the number of threads, or what ran before.

    Args:
        robot: name of the robot model, see `bns robots`.
        damage: what is wrong with the robots, by trial: one `Damage` (or effects as
            text or objects) for all, or a sequence of such with one per robot.
        reality: effects that always hold (unless they have a schedule): how this
            world departs from the nominal model, which is no damage.
        sample_dt: time between two samples of the tracker [s]; the end of each
            command is sampled as well.
        threads: of the physics.
        start: pose at the start of each trial in the world frame [m, m, rad].
        arena: size of the board along x and y [m], its centre the world's origin.
        name: name of the world in the trials.
        truth: whether trials carry hidden states (`qpos`, `qvel` at the samples).

    Raises:
        UnknownNameError: no such robot or effect.
        OutOfBoundsError: a number outside its bounds, a start outside the arena.
        BnsError: an effect that this robot or world cannot have.
    """

    stages = STAGES

    def __init__(
        self,
        robot: str = "khepera3",
        *,
        damage: Damage | Sequence = (),
        reality: Damage | Sequence = (),
        sample_dt: float = 0.1,
        threads: int = 2,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        arena: Sequence[float] = (2.7, 1.8),
        name: str = "mujoco",
        truth: bool = False,
    ):
        self.model = models.robot(robot)
        self.robot, self.name, self.truth = robot, name, truth
        self._channels, self._limits = self.model.channels, self.model.limits
        self.damage = active.per_robot(damage)
        self.reality = active.as_damage(reality)
        given = self.damage if isinstance(self.damage, tuple) else (self.damage,)
        for item in (*given, self.reality):
            active.refuse(item, stages=self.stages, kind=self.model.kind, world=name)
        self.arena = (float(arena[0]), float(arena[1]))
        self.start = checked_start(start, self.arena)
        self.sample_dt = bounded("sample_dt", sample_dt, self.dt, 60.0, "s")
        self._pool = Pool(int(bounded("threads", threads, 1, 1024, "1")))

    @property
    def dt(self) -> float:
        """Physics step [s]."""
        return float(compile.compiled(self.robot).model.opt.timestep)

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on each of N robots, see `World.run`.

        Raises:
            BnsError: numbers of commands, seeds and damages disagree; commands that
                the robot cannot be told.
        """
        plans = self.plan(commands, trial=trial, seeds=seeds)
        motions = self._pool.map([plan.job for plan in plans])
        return [
            self._observe(plan, motion, trial)
            for plan, motion in zip(plans, motions, strict=True)
        ]

    def plan(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Plan]:
        """What `run` hands to the physics, for benches and tests; arguments alike."""
        damages, seeds = shared(self.damage, seeds, len(commands))
        return [
            self._plan(item, damage, trial, seed)
            for item, damage, seed in zip(commands, damages, seeds, strict=True)
        ]

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

    def _about(self) -> dict[str, object]:
        """What is true of every trial, for its record."""
        return {"mujoco": mujoco.__version__}

    def _observe(self, plan: Plan, motion: Motion, trial: int) -> Trial:
        scene = plan.job.segments[0].compiled.model
        place = compile.free_joint(scene)
        free = motion.states[:, 1 + place.start : 1 + place.stop]
        every = max(self.sample_dt / self.dt, 1.0)
        sampled, boundaries = observe.sample_steps(plan.counts, every)
        poses = observe.planar(free, self.start[2])
        grid = np.arange(len(poses)) * self.dt
        times, seen = observe.tracked(
            poses[sampled],
            grid[sampled],
            poses,
            grid,
            plan.stages.tracking,
            plan.seed,
            trial,
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
