"""Making a repertoire: MAP-Elites in a model of the undamaged robot, step by step.

A generation is `BATCH` controllers and draws from a stream of its own, so that a making
that was stopped, or is to be longer, goes on to what it would have been.

Duty factors, the share of time each foot is on the ground, are the behaviour of Cully
et al. (2015). They need what only a simulation tells, where the body is in space; the
legs are where the servos reported.
"""

from collections.abc import Callable, Sequence
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np

from bns import seeding
from bns.errors import BnsError, UnknownNameError
from bns.experiment import robots
from bns.experiment.config import RunConfig
from bns.experiment.versions import package
from bns.experiment.world_factory import make_world
from bns.models.phantomx import kinematics
from bns.prior import repertoire
from bns.prior.archive import Archive
from bns.tasks import registry as tasks
from bns.worlds.trial import Trial

BATCH = 64
"""evaluations of a generation"""
FIRST = 8
"""generations of random controllers"""
KEEP = 16
"""generations between two states kept, at which the growth is noted"""

BEHAVIOURS = ("contact", "told")
"""duty factors as they went (phantomx), or the task's own behaviour"""


@dataclass(frozen=True, kw_only=True)
class Plan:
    """What is to be made.

    Attributes:
        config: task, robot, world and controllers; its damage plays no part.
        genotype: which of `Task.genotypes`.
        behaviour: which of `BEHAVIOURS`.
        bins: of the grid along each behaviour.
        step: of the physics [s], 0 = the model's own.
        seed: of all that is drawn.
    """

    config: RunConfig
    genotype: str = "gait"
    behaviour: str = "contact"
    bins: int = 5
    step: float = 0.008
    seed: int = 1


class Maker:
    """A repertoire in the making.

    Args:
        plan: what.
        world: where, instead of the one that the plan says.

    Attributes:
        archive: elites so far.
        evaluations: executions so far.
        growth: rows of `Head.growth`.

    Raises:
        UnknownNameError: no such genotype or behaviour.
        BnsError: a robot, task or world that cannot be.
    """

    def __init__(self, plan: Plan, world: Any = None):
        self.plan = plan
        bare = replace(plan.config.world, damage=())
        self.config = replace(plan.config, world=bare)
        self.task = tasks.of(self.config)
        genotypes = self.task.genotypes
        if plan.genotype not in genotypes:
            raise UnknownNameError("genotype", plan.genotype, genotypes)
        if plan.behaviour not in BEHAVIOURS:
            raise UnknownNameError("behaviour", plan.behaviour, BEHAVIOURS)
        self.space = genotypes[plan.genotype]
        self.world = world or _model(self.config, plan)
        middle = self.space.controllers((self.space.low + self.space.high)[None] / 2)
        (seen,) = self._behaviours(self._run(middle, [0]))
        self.archive = Archive(self.space.size, len(seen), plan.bins)
        self.evaluations = 0
        self.growth: list[tuple[int, int, float, float]] = []

    def _run(self, tried: Sequence[Any], seeds: Sequence[int]) -> list[Trial]:
        return self.task.execute(self.world, tried, trial=0, seeds=seeds)

    def _behaviours(self, trials: Sequence[Trial]) -> np.ndarray:
        if self.plan.behaviour == "contact":
            return duty(trials)
        return self.task.behaviour(trials)

    def restore(self, found: repertoire.Repertoire) -> None:
        """Go on from a repertoire.

        Raises:
            BnsError: it was made otherwise.
        """
        head, mine = found.head, self._head("")
        for name in ("task", "robot", "model", "world", "step", "reality", "genotype",
                     "behaviour", "bins", "controllers", "seed"):  # fmt: skip
            if getattr(head, name) != mine[name]:
                raise BnsError(
                    f"The repertoire to go on from was made with {name} = "
                    f"{getattr(head, name)!r}, not {mine[name]!r}: give the same "
                    "settings, or another --out."
                )
        self.archive.restore(
            {"genes": found.genes, "behaviours": found.behaviours, "worth": found.worth}
        )
        self.evaluations = head.evaluations
        self.growth = [
            (evaluations, cells, best, quality)
            for evaluations, cells, best, quality in head.growth
            if _noted(evaluations)
        ]

    def advance(self) -> None:
        """One generation."""
        number = self.evaluations // BATCH
        rng = seeding.generator(self.plan.seed, "repertoire", number)
        space, archive = self.space, self.archive
        width = np.maximum(space.high - space.low, 1e-12)
        if number < FIRST or not len(archive):
            genes = (space.random(BATCH, rng) - space.low) / width
        else:
            genes = archive.bred(BATCH, rng)
        genes = repertoire.quantised(genes)
        tried = space.controllers(space.low + genes * width)
        first = seeding.integer(self.plan.seed, "repertoire-world", number)
        trials = self._run(tried, [first + at for at in range(BATCH)])
        worth = self.task.worth(trials).astype(np.float32).astype(float)
        seen = self._behaviours(trials).astype(np.float32).astype(float)
        archive.add(genes, seen, worth)
        self.evaluations += BATCH
        if _noted(self.evaluations):
            self.growth.append(self.row)

    @property
    def row(self) -> tuple[int, int, float, float]:
        """Evaluations, cells, best worth and worth of all together, now."""
        best = float(self.archive.worth.max(initial=0.0))
        quality = self.archive.quality
        return self.evaluations, len(self.archive), round(best, 5), round(quality, 5)

    def _head(self, command: str) -> dict[str, Any]:
        plan, world = self.plan, self.config.world
        growth = self.growth if _noted(self.evaluations) else [*self.growth, self.row]
        return {
            "command": command,
            "task": self.config.task.name,
            "robot": world.robot,
            "model": robots.digest(world.robot),
            "world": world.name,
            "step": plan.step,
            "reality": list(world.reality),
            "genotype": plan.genotype,
            "behaviour": plan.behaviour,
            "bins": plan.bins,
            "controllers": repertoire.controllers(self.config),
            "seed": plan.seed,
            "evaluations": self.evaluations,
            "growth": growth,
            "versions": {name: package(name) for name in ("mujoco", "numpy")},
        }

    def write(self, file: Path, command: str) -> None:
        """Keep what there is.

        Args:
            file: to be written, whole or not at all.
            command: that makes it.

        Raises:
            StorageError: no space, or no permission.
        """
        repertoire.write(file, self._head(command), self.archive.state())


def _noted(evaluations: int) -> bool:
    """Whether a row of the growth curve is kept for good after so many."""
    return evaluations > 0 and evaluations % (KEEP * BATCH) == 0


def _model(config: RunConfig, plan: Plan) -> Any:
    """The world of a plan, with the hidden states if contacts are looked at."""
    told: dict[str, Any] = {"step": plan.step} if plan.step else {}
    if plan.behaviour == "contact":
        told["truth"] = True
    return make_world(config, **told)


def make(
    maker: Maker,
    file: Path,
    *,
    evaluations: int,
    command: str,
    on_kept: Callable[[Maker], None] = lambda maker: None,
    stop: Callable[[], bool] = lambda: False,
) -> bool:
    """Go on until so many evaluations are spent; kept every `KEEP` generations.

    Args:
        maker: fresh or restored.
        file: of the repertoire.
        evaluations: in all, rounded up to whole generations.
        command: that makes it.
        on_kept: called each time that something was kept.
        stop: asked after every generation; True ends the making there.

    Returns:
        Whether it was finished.

    Raises:
        BnsError: no evaluations to spend.
        StorageError: no space, or no permission.
    """
    if evaluations < 1:
        raise BnsError(
            f"A repertoire of {evaluations} evaluations holds nothing: give "
            "--evaluations 1 or more."
        )
    stopped = False
    while maker.evaluations < evaluations and not stopped:
        maker.advance()
        stopped = stop()
        if _noted(maker.evaluations) or stopped:
            maker.write(file, command)
            on_kept(maker)
    maker.write(file, command)
    return not stopped or maker.evaluations >= evaluations


GROUND = 0.005
"""[m] a foot below it touches the ground; its centre rests at 1.3 to 1.8 mm"""


def duty(trials: Sequence[Trial]) -> np.ndarray:
    """Share of the samples in which each foot touches the ground.

    Args:
        trials: N of a world with `truth`, of the robot phantomx.

    Returns:
        ``(N, 6)``, NaN where the physics diverged.

    Raises:
        BnsError: trials without the hidden states, or of another robot.
    """
    return np.array([_duty(trial) for trial in trials])


def _duty(trial: Trial) -> np.ndarray:
    if "qpos" not in trial.truth or trial.observed.shape[1] < 21:
        raise BnsError(
            "Contacts are known of the robot 'phantomx' in a world with truth alone: "
            "give --behaviour told."
        )
    if not trial.outcome.usable:
        return np.full(6, np.nan)
    free = trial.truth["qpos"][:, :7]
    feet = kinematics.feet(trial.observed[:, 3:21])
    x, y = free[:, 4], free[:, 5]
    w, z = free[:, 3], free[:, 6]
    up = np.stack([2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)])
    heights = free[:, 2, None] + np.einsum("ks,slk->sl", up, feet)
    found: np.ndarray = (heights < GROUND).mean(0)
    return found
