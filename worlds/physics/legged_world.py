"""The physics world of walking robots: servo goals, each until the robot rests."""

from collections.abc import Sequence
from concurrent.futures import ThreadPoolExecutor
from typing import NamedTuple, Unpack

import numpy as np

from bns import models
from bns.models.ax12a import SPEED_UNIT
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, of_kind
from bns.worlds.damage import Damage
from bns.worlds.physics import control, legged_plan, observe
from bns.worlds.physics.control import in_units
from bns.worlds.physics.legged_plan import Servos
from bns.worlds.physics.rollout import Walk, WalkJob, walk
from bns.worlds.physics.world import PhysicsWorld, Settings
from bns.worlds.trial import POSE_CHANNELS, Channel, Commands, Trial

STAGES = ("command", "actuator", "body", "sensor", "tracking")
SPEED = round(300 * SPEED_UNIT, 4)  # [rad/s] moving speed register 300; assumed
LOADS_EVERY = 5  # steps at which the servos' loads are looked at


class Plan(NamedTuple):
    """One robot's trial before it is run."""

    commands: Commands
    stages: Stages
    seed: int
    servos: Servos
    job: WalkJob


class HexapodWorld(PhysicsWorld[Plan]):
    """Walking robots in MuJoCo: a command is a goal for every servo, until they rest.

    Each command lasts until servos and body are at rest, at most as long as it is told
    (`Commands.durations`); the actual times are the trial's. Observed are the pose and,
    after it, the position that each servo reports. A trial depends on its commands,
    damage, trial number and seed alone.

    Goals are those of the servos from half-way [rad], signs alike for all legs: coxa
    forward, femur up, tibia outward. One beyond a servo's end stops is refused; what an
    effect moves beyond them ends there, as on the robot.

    Args:
        robot: name of the robot model, see `bns robots`.
        speed: moving speed of the servos [rad/s].
        step: physics step [s]; 0 = the model's own. At 8 ms a trial costs half of
            what it does at 4 ms (bench `hexapod-step`).
        name: of the world in the trials.
        settings: damage, reality, sample_dt, threads, start, arena, truth, see
            `Settings`.

    Raises:
        UnknownNameError: no such robot or effect.
        OutOfBoundsError: a number outside its bounds, a start outside the arena.
        BnsError: an effect that this robot or world cannot have, effects that take all
            legs away or let the robot start fallen.
    """

    stages = STAGES

    def __init__(
        self,
        robot: str = "phantomx",
        *,
        speed: float = SPEED,
        step: float = 0.0,
        name: str = "hexapod",
        **settings: Unpack[Settings],
    ):
        model = of_kind("legged", models.robot(robot))
        self.step = bounded("step", step, 0.0005, 0.02, "s") if step else 0.0
        super().__init__(robot, model, name=name, **settings)
        self._ranges = self.model.ranges
        readings = (Channel(f"{c.name}_position", c.unit) for c in self.model.commands)
        self.channels = (*POSE_CHANNELS, *readings)
        self.speed = bounded("speed", speed, 0.01, 100.0, "rad/s")
        several = self.threads > 1
        self._threads = ThreadPoolExecutor(self.threads) if several else None
        legged_plan.refuse_fallen(robot, self.reality, self.start, self._channels)

    @property
    def dt(self) -> float:
        """Physics step [s]."""
        return self.step or legged_plan.timestep(self.robot)

    def motions(self, plans: Sequence[Plan]) -> list[Walk]:
        """What the physics makes of plans, see `PhysicsWorld.motions`."""
        jobs = [plan.job for plan in plans]
        if self._threads is None or len(jobs) == 1:
            return [walk(job) for job in jobs]
        return list(self._threads.map(walk, jobs))

    def _refuse(self, damage: Damage) -> None:
        legged_plan.refuse_legless(self.reality + damage, self.model)

    def _about(self) -> dict[str, object]:
        step = {"step": self.step} if self.step else {}
        return {"speed": self.speed} | step | super()._about()

    def _plan(self, commands: Commands, damage: Damage, trial: int, seed: int) -> Plan:
        control.check(commands, self._channels, self._ranges, self.robot)
        stages = Stages.of(self.reality, damage, trial, commands.duration)
        job, servos = legged_plan.job(
            self.robot,
            commands,
            stages,
            start=self.start,
            speed=self.speed,
            seed=seed,
            trial=trial,
            step=self.step,
        )
        return Plan(commands, stages, seed, servos, job)

    def _observe(self, plan: Plan, done: Walk, trial: int) -> Trial:
        servos, states = plan.servos, done.states
        free = states[:, 1:8]
        sampled, boundaries, times, seen = self._watched(
            free, done.counts, plan.stages, plan.seed, trial
        )
        readings = states[np.ix_(sampled, servos.angles)] + servos.laws["offset"]
        readings = in_units(readings, servos.laws["quantisation"])
        some = slice(None, -1, LOADS_EVERY)
        outcome = observe.legged_outcome(
            free,
            states[some, servos.angles],
            states[some, servos.speeds],
            done.control[::LOADS_EVERY],
            servos.laws,
            servos.carried,
            dt=self.dt * LOADS_EVERY,
            arena=self.arena,
            touched=bool(done.touched.any()),
            rested=bool(done.rested.all()),
            diverged=done.diverged >= 0,
        )
        return Trial(
            commands=plan.commands,
            times=times,
            observed=np.column_stack([seen, readings]),
            boundaries=boundaries,
            channels=self.channels,
            outcome=outcome,
            robot=self.robot,
            world=self.name,
            conditions=plan.stages.conditions(trial, plan.seed) | self._about(),
            truth=servos.hidden(states[sampled]) if self.truth else {},
        )
