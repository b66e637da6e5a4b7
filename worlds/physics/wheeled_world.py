"""The physics world: robots in MuJoCo, each with its own damage, in batches."""

from collections.abc import Sequence
from typing import NamedTuple

import numpy as np

from bns import models
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, of_kind
from bns.worlds.damage import Damage
from bns.worlds.physics import compile, control, observe
from bns.worlds.physics.loops import Loops
from bns.worlds.physics.rollout import Job, Motion, Pool
from bns.worlds.physics.world import PhysicsWorld
from bns.worlds.trial import Commands, Trial

STAGES = ("command", "actuator", "body", "tracking")


class Plan(NamedTuple):
    """One robot's trial before it is run."""

    commands: Commands
    stages: Stages
    seed: int
    counts: np.ndarray  # physics steps of each command, (K,)
    job: Job


class MujocoWorld(PhysicsWorld[Plan], Loops):
    """Robots on wheels that execute commands in MuJoCo, N at a time.

    Args:
        robot: name of the robot model, see `bns robots`.
        threads: of the physics.
        damage, reality, sample_dt, start, arena, name, truth: see `PhysicsWorld`.

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
        super().__init__(
            robot,
            of_kind("wheeled", models.robot(robot)),
            damage=damage,
            reality=reality,
            sample_dt=sample_dt,
            start=start,
            arena=arena,
            name=name,
            truth=truth,
        )
        self._limits = self.model.limits
        self._pool = Pool(int(bounded("threads", threads, 1, 1024, "1")))

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
        every = max(self.sample_dt / self.dt, 1.0)
        sampled, boundaries = observe.sample_steps(plan.counts, every)
        poses = observe.planar(free, self.start[2])
        times, seen = observe.watched(
            poses,
            sampled,
            dt=self.dt,
            effects=plan.stages.tracking,
            seed=plan.seed,
            trial=trial,
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
