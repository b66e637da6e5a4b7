"""What all physics worlds share: settings, and trials planned, moved, observed."""

from abc import ABC, abstractmethod
from collections.abc import Sequence
from typing import Any, ClassVar, Generic, Self, TypedDict, TypeVar

import mujoco
import numpy as np

from bns.models.robot_model import RobotModel
from bns.worlds import active
from bns.worlds.active import Stages
from bns.worlds.checks import bounded, checked_start, shared
from bns.worlds.damage import Damage
from bns.worlds.physics import observe
from bns.worlds.trial import Channel, Commands, Trial

PlanT = TypeVar("PlanT")


class Settings(TypedDict, total=False):
    """What all physics worlds can be given, by keyword.

    Attributes:
        damage: what is wrong with the robots, by trial: one `Damage` (or effects as
            text or objects) for all, or a sequence of such with one per robot.
        reality: effects that always hold (unless they have a schedule): how the world
            departs from the nominal model, which is no damage.
        sample_dt: time between two samples of the tracker [s]; the end of each command
            is sampled as well.
        threads: of the physics.
        start: pose at the start of each trial in the world frame [m, m, rad].
        arena: size of the board along x and y [m], its centre the world's origin.
        truth: whether trials carry hidden states (`qpos`, `qvel` at the samples).
    """

    damage: Damage | Sequence
    reality: Damage | Sequence
    sample_dt: float
    threads: int
    start: Sequence[float]
    arena: Sequence[float]
    truth: bool


class PhysicsWorld(ABC, Generic[PlanT]):
    """Robots that execute commands in MuJoCo, N at a time.

    A trial depends on its commands, damage, trial number and seed alone: not on the
    other robots of the batch, their order, the number of threads, or what ran before.

    Args:
        robot: name of the robot model, as it was given.
        model: of the robot.
        name: of the world in the trials.
        damage, reality, sample_dt, threads, start, arena, truth: see `Settings`.

    Raises:
        UnknownNameError: no such effect.
        OutOfBoundsError: a number outside its bounds, a start outside the arena.
        BnsError: an effect that this robot or world cannot have.
    """

    stages: ClassVar[tuple[str, ...]]

    def __init__(
        self,
        robot: str,
        model: RobotModel,
        *,
        name: str,
        damage: Damage | Sequence = (),
        reality: Damage | Sequence = (),
        sample_dt: float = 0.1,
        threads: int = 2,
        start: Sequence[float] = (0.0, 0.0, 0.0),
        arena: Sequence[float] = (2.7, 1.8),
        truth: bool = False,
    ):
        self.robot, self.model = robot, model
        self._channels = tuple(Channel(*item) for item in model.channels)
        self.name, self.truth = name, truth
        self.damage = active.per_robot(damage)
        self.reality = active.as_damage(reality)
        given = self.damage if isinstance(self.damage, tuple) else (self.damage,)
        for item in (*given, self.reality):
            active.refuse(item, stages=self.stages, kind=model.kind, world=name)
            self._refuse(item)
        self.arena = (float(arena[0]), float(arena[1]))
        self.start = checked_start(start, self.arena)
        self.sample_dt = bounded("sample_dt", sample_dt, self.dt, 60.0, "s")
        self.threads = int(bounded("threads", threads, 1, 1024, "1"))

    @property
    @abstractmethod
    def dt(self) -> float:
        """Physics step [s]."""

    def _watched(
        self,
        free: np.ndarray,
        counts: np.ndarray,
        stages: Stages,
        seed: int,
        trial: int,
    ) -> tuple[np.ndarray, np.ndarray, np.ndarray, np.ndarray]:
        """What the tracker reports of a robot's base, ``(S + 1, 7)``.

        Returns:
            steps that are samples ``(T,)``, those at commands' ends ``(K + 1,)``, time
            stamps ``(T,)`` [s] and poses ``(T, 3)``.
        """
        every = max(self.sample_dt / self.dt, 1.0)
        sampled, boundaries = observe.sample_steps(counts, every)
        times, seen = observe.watched(
            observe.planar(free, self.start[2]),
            sampled,
            dt=self.dt,
            effects=stages.tracking,
            seed=seed,
            trial=trial,
        )
        return sampled, boundaries, times, seen

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on each of N robots, see `World.run`.

        Args:
            commands: N lists of commands, one a robot.
            trial: number of this trial, counted from 0.
            seeds: of what is random, one a robot; empty means 0, 1, 2, ...

        Raises:
            BnsError: numbers of commands, seeds and damages disagree; commands that
                the robot cannot be told.
        """
        plans = self.plan(commands, trial=trial, seeds=seeds)
        return [
            self._observe(plan, motion, trial)
            for plan, motion in zip(plans, self.motions(plans), strict=True)
        ]

    def plan(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[PlanT]:
        """What `run` hands to the physics, for benches and tests; arguments alike.

        Args:
            commands: N lists of commands, one a robot.
            trial: number of this trial, counted from 0.
            seeds: of what is random, one a robot; empty means 0, 1, 2, ...
        """
        damages, seeds = shared(self.damage, seeds, len(commands))
        return [
            self._plan(item, damage, trial, seed)
            for item, damage, seed in zip(commands, damages, seeds, strict=True)
        ]

    def having(self, damages: Sequence[Damage]) -> Self:
        """The same world with other damage, see `active.having`."""
        return active.having(self, damages, self.stages, self.model.kind)

    @abstractmethod
    def motions(self, plans: Sequence[PlanT]) -> list[Any]:
        """What the physics makes of plans, for benches and tests."""

    @abstractmethod
    def _plan(self, commands: Commands, damage: Damage, trial: int, seed: int) -> PlanT:
        """What the physics is to do in a trial of one robot."""

    @abstractmethod
    def _observe(self, plan: PlanT, motion: Any, trial: int) -> Trial:
        """The trial of what the physics did."""

    def _refuse(self, damage: Damage) -> None:
        """Raise `BnsError` for damage that makes no sense on this robot."""

    def _about(self) -> dict[str, object]:
        """What is true of every trial, for its record."""
        return {"mujoco": mujoco.__version__}
