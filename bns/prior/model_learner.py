"""Learners that evolve controllers in a model of the robot: what they share.

Before each trial a learner evolves a population of controllers in its model,
of which it may run `each` a trial. One of them is tried on the robot. Deployed is the
best one that was seen to work since the robot changed; before anything was seen, the
one that the model likes best.

Controllers are vectors in the unit cube. A generation of one goal: tournaments of
`TOURNAMENT`, one-point crossover (vectors are lists of commands, joint by joint or one
after another), a normal step on a few genes, and the best of parents and children
survive. The numbers are the best of those tried on navigation with 2,500 evaluations.
For several goals NSGA-II (Deb et al. 2002) says who survives.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, TypeVar, cast

import numpy as np

from bns import seeding
from bns.experiment.config import LearnerSettings
from bns.learners.base import Proposal, RememberingLearner
from bns.tasks.base import Space, Task
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld

TOURNAMENT = 3
CROSSED = 0.5
"""share of children with two parents"""
STEP, CHANGED = 0.2, 0.05
"""standard deviation of a step, as a share of a gene's range; share of genes changed"""


def bred(genes: np.ndarray, count: int, rng: np.random.Generator) -> np.ndarray:
    """Children of a population.

    Args:
        genes: each from 0 to 1, the best individual first, ``(P, D)``.
        count: of children, N.
        rng: the only source of randomness.

    Returns:
        ``(N, D)``, each from 0 to 1.
    """
    size, length = genes.shape
    one, other = rng.integers(size, size=(2, count, TOURNAMENT)).min(axis=2)
    cut = rng.integers(1, length + 1, (count, 1))
    cut = np.where(rng.random((count, 1)) < CROSSED, cut, length)
    children = np.where(np.arange(length) < cut, genes[one], genes[other])
    changed = rng.random(children.shape) < CHANGED
    steps = STEP * rng.standard_normal(children.shape)
    return inside(np.where(changed, children + steps, children))


def inside(genes: np.ndarray) -> np.ndarray:
    """Genes that left the unit cube, reflected at its sides; shape like theirs."""
    found: np.ndarray = 1.0 - np.abs(1.0 - genes % 2.0)
    return found


def ranked(costs: np.ndarray) -> np.ndarray:
    """Rows in the order in which NSGA-II keeps them, ``(N,)``.

    By front; within one, those with more room around them first.

    Args:
        costs: of several goals, all lower is better, ``(N, G)``.
    """
    order: list[np.ndarray] = []
    for front in fronts(costs):
        room = crowding(costs[front])
        order.append(front[np.argsort(-room, kind="stable")])
    return np.concatenate(order) if order else np.empty(0, np.int64)


def fronts(costs: np.ndarray) -> list[np.ndarray]:
    """Rows that nothing dominates, those that only these dominate, and so on.

    Args:
        costs: of several goals, all lower is better, ``(N, G)``.
    """
    no_worse = (costs[:, None] <= costs[None]).all(2)
    better = np.asarray(no_worse & (costs[:, None] < costs[None]).any(2))
    left, found = np.ones(len(costs), bool), []
    while left.any():
        front = np.flatnonzero(left & ~better[left].any(0))
        found.append(front)
        left[front] = False
    return found


def crowding(costs: np.ndarray) -> np.ndarray:
    """Room around each member of a front, ``(N,)``; infinite at its ends.

    Args:
        costs: of several goals, ``(N, G)``.
    """
    room = np.zeros(len(costs))
    for values in costs.T:
        order = np.argsort(values, kind="stable")
        width = values[order[-1]] - values[order[0]]
        if width > 0:
            room[order[1:-1]] += (values[order[2:]] - values[order[:-2]]) / width
            room[order[[0, -1]]] = np.inf
    return room


@dataclass(frozen=True, kw_only=True)
class ModelLearnerSettings(LearnerSettings):
    """Settings of learners that evolve controllers in a model."""

    population: int = 10
    """controllers that are kept"""
    first: int = 1000
    """evaluations of the model before the first trial"""
    each: int = 50
    """evaluations of the model before every other trial"""
    remembered: int = 50
    """tests on the robot that are remembered, the newest"""
    told: Literal["onset", "never"] = "onset"
    """onset: told when the robot was damaged, and what was seen before is forgotten;
    never: it is forgotten as tests get old alone"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "population": (2, 100_000, "controllers"),
        "first": (1, 1e9, "evaluations"),
        "each": (0, 1e9, "evaluations"),
        "remembered": (1, 10_000, "tests"),
    }


class Memory:
    """What one run knows; all attributes are arrays.

    Attributes:
        genes: of the population, each from 0 to 1, the best one first, ``(P, D)``.
        worth: what they achieve in the model, higher is better, ``(P,)``.
        tests: genes tried on the robot since it changed, ``(T, D)``.
        seen: what they achieved there, ``(T,)``.
        tried: genes of this trial, ``(D,)``.
        waiting: genes to be tried next whatever is thought, ``(W, D)``, W 0 or 1.
    """

    def __init__(self, size: int):
        self.genes, self.worth = np.empty((0, size)), np.empty(0)
        self.tests, self.seen = np.empty((0, size)), np.empty(0)
        self.tried, self.waiting = np.zeros(size), np.empty((0, size))

    def keep(self, rows: np.ndarray) -> None:
        """The population's rows ``(K,)`` that are kept, in order."""
        self.genes, self.worth = self.genes[rows], self.worth[rows]

    def forget(self, newest: int) -> None:
        """Forget all tests but so many of the newest."""
        first = max(len(self.seen) - newest, 0)
        self.tests, self.seen = self.tests[first:], self.seen[first:]

    @property
    def untested(self) -> np.ndarray:
        """Members of the population that were not tried yet, ``(P,)`` bool."""
        same = (self.genes[:, None] == self.tests[None]).all(2)
        found: np.ndarray = ~same.any(1)
        return found


MemoryT = TypeVar("MemoryT", bound=Memory)


class Rollouts:
    """A run's model and what of it may be run before one trial.

    Args:
        task: what is learned.
        space: of the vectors.
        model: counted.
        most: evaluations that may be spent.
        rng: of all that is drawn.
    """

    def __init__(
        self,
        task: Task,
        space: Space,
        model: CountedWorld,
        most: int,
        rng: np.random.Generator,
    ):
        self._task, self._space, self._model, self.rng = task, space, model, rng
        self._floor = max(model.left - most, 0)

    @property
    def room(self) -> int:
        """Evaluations that are left."""
        return max(self._model.left - self._floor, 0)

    def random(self, count: int) -> np.ndarray:
        """Genes of random controllers, ``(count, D)``."""
        space = self._space
        width = np.maximum(space.high - space.low, 1e-12)
        return (space.random(count, self.rng) - space.low) / width

    def run(self, genes: np.ndarray, damages: Sequence[Damage] = ()) -> list[Trial]:
        """Run controllers in the model, each charged.

        Args:
            genes: ``(N, D)``.
            damages: what is wrong with the model's robot in each; none = nothing.
        """
        if not len(genes):
            return []
        world = self._model.having(damages) if len(damages) else self._model
        tried = controllers(self._space, genes)
        seeds = self.rng.integers(2**31, size=len(genes)).tolist()
        return self._task.execute(world, tried, trial=0, seeds=seeds)


def controllers(space: Space, genes: np.ndarray) -> list[Any]:
    """Controllers of genes ``(N, D)``, each from 0 to 1."""
    return space.controllers(space.low + genes * (space.high - space.low))


class ModelLearner(RememberingLearner, Generic[MemoryT]):
    """R runs that evolve controllers in a model; arguments as `Learner`."""

    Settings: ClassVar[type[LearnerSettings]] = ModelLearnerSettings
    columns: ClassVar[Mapping[str, str]] = {
        "worth_seen": "what the controller tried achieved (walking: m; elsewhere the "
        "cost, its sign turned)",
    }
    needs_model = True
    deploys = True

    def begin(self) -> None:
        """See `Learner.begin`."""
        self.rule: Any = self.config.settings
        self.space = self.task.searched
        self.memories: list[MemoryT] = [self.memory() for _ in range(self.runs)]

    @abstractmethod
    def memory(self) -> MemoryT:
        """What a run knows at first."""

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`."""
        most = self.rule.first if trial == 0 else self.rule.each
        best = []
        for run, memory in enumerate(self.memories):
            if self.rule.told == "onset" and trial == self.onsets[run] + 1 > 0:
                self.changed(memory)
            names = (self.config.learner, self.replicates[run], trial)
            rng = seeding.generator(self.config.seed, *names)
            rollouts = Rollouts(self.task, self.space, self.models[run], most, rng)
            self.prepare(memory, rollouts)
            if len(memory.waiting):
                memory.tried, memory.waiting = memory.waiting[0], memory.waiting[:0]
            else:
                memory.tried = self.chosen(memory, rollouts, trial)
            best.append(self.deployed(memory))
        tried = np.stack([memory.tried for memory in self.memories])
        return Proposal(self.controllers(tried), self.controllers(np.stack(best)))

    def controllers(self, genes: np.ndarray) -> list[Any]:
        """Controllers of genes ``(N, D)``, each from 0 to 1."""
        return controllers(self.space, genes)

    def changed(self, memory: MemoryT) -> None:
        """The newest trial was the first of a robot that is another one.

        What was deployed is tried first: it may work still.
        """
        best = int(memory.seen.argmax())
        if best < len(memory.seen) - 1:
            memory.waiting = memory.tests[[best]]
        memory.forget(newest=1)

    def prepare(self, memory: MemoryT, rollouts: Rollouts) -> None:
        """Evolve, as far as the rollouts go."""
        self.evolve(memory, rollouts)

    def evolve(
        self, memory: MemoryT, rollouts: Rollouts, damages: Sequence[Damage] = ()
    ) -> None:
        """Generations in the model until the rollouts are spent.

        Args:
            memory: whose population.
            rollouts: which the model may run.
            damages: the one that the model's robot has, if any.
        """
        while rollouts.room:
            count = min(self.rule.population, rollouts.room)
            fresh = not len(memory.genes)
            genes = (
                rollouts.random(count)
                if fresh
                else bred(memory.genes, count, rollouts.rng)
            )
            trials = rollouts.run(genes, [*damages] * count)
            self.add(memory, genes, trials)
            memory.keep(self.survivors(memory)[: self.rule.population])

    def add(self, memory: MemoryT, genes: np.ndarray, trials: Sequence[Trial]) -> None:
        """Put controllers that the model ran into a population.

        Args:
            memory: whose population.
            genes: theirs, ``(N, D)``.
            trials: in the model, N.
        """
        memory.genes = np.vstack([memory.genes, genes])
        memory.worth = np.append(memory.worth, self.task.worth(trials))

    def survivors(self, memory: MemoryT) -> np.ndarray:
        """Rows of the population, ``(P,)``, the first to survive first."""
        return np.argsort(-memory.worth, kind="stable")

    @abstractmethod
    def chosen(self, memory: MemoryT, rollouts: Rollouts, trial: int) -> np.ndarray:
        """Genes to try, ``(D,)``.

        Args:
            memory: of the run.
            rollouts: with what is left of the trial's evaluations.
            trial: its number.
        """

    def deployed(self, memory: MemoryT) -> np.ndarray:
        """Genes of what a user would run now, ``(D,)``."""
        if len(memory.seen):
            return cast(np.ndarray, memory.tests[memory.seen.argmax()])
        return cast(np.ndarray, memory.genes[memory.worth.argmax()])

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del trial, best
        worth, rows = self.task.worth(tried), []
        for memory, seen, value in zip(self.memories, tried, worth, strict=True):
            rows.append(self.learn(memory, seen, float(value)))
            memory.tests = np.vstack([memory.tests, memory.tried])
            memory.seen = np.append(memory.seen, value)
            memory.forget(self.rule.remembered)
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return {"worth_seen": worth, **columns}

    @abstractmethod
    def learn(self, memory: MemoryT, seen: Trial, worth: float) -> dict[str, Any]:
        """Learn from a trial, before it is remembered as a test.

        Args:
            memory: of the run.
            seen: the trial.
            worth: what it achieved.

        Returns:
            The learner's own columns.
        """
