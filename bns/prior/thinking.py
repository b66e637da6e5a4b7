"""Learners that evolve controllers in a model of the robot: what they share.

Before each trial a learner thinks: it evolves a population of controllers in its model,
of which it may run `each` a trial. One of them is tried on the robot. Deployed is the
best one that was seen to work since the robot changed; before anything was seen, the
one that the model likes best.
"""

from abc import abstractmethod
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, Generic, Literal, TypeVar, cast

import numpy as np

from bns import seeding
from bns.experiment.config import LearnerSettings
from bns.learners.base import Learner, Proposal
from bns.prior.breeding import bred
from bns.tasks.base import Space, Task
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld


@dataclass(frozen=True, kw_only=True)
class ThinkingSettings(LearnerSettings):
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


class Mind:
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


MindT = TypeVar("MindT", bound=Mind)


class Desk:
    """A run's model while it thinks before one trial.

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


class Thinker(Learner, Generic[MindT]):
    """R runs that evolve controllers in a model; arguments as `Learner`."""

    Settings: ClassVar[type[LearnerSettings]] = ThinkingSettings
    needs_model = True
    deploys = True

    def begin(self) -> None:
        """See `Learner.begin`."""
        self.rule: Any = self.config.settings
        self.space = self.task.searched
        self.minds: list[MindT] = [self.mind() for _ in range(self.runs)]

    @abstractmethod
    def mind(self) -> MindT:
        """What a run knows at first."""

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`."""
        most = self.rule.first if trial == 0 else self.rule.each
        best = []
        for run, mind in enumerate(self.minds):
            if self.rule.told == "onset" and trial == self.onsets[run] + 1 > 0:
                self.changed(mind)
            names = (self.config.learner, self.replicates[run], trial)
            rng = seeding.generator(self.config.seed, *names)
            desk = Desk(self.task, self.space, self.models[run], most, rng)
            self.prepare(mind, desk)
            if len(mind.waiting):
                mind.tried, mind.waiting = mind.waiting[0], mind.waiting[:0]
            else:
                mind.tried = self.chosen(mind, desk, trial)
            best.append(self.deployed(mind))
        tried = np.stack([mind.tried for mind in self.minds])
        return Proposal(self.controllers(tried), self.controllers(np.stack(best)))

    def controllers(self, genes: np.ndarray) -> list[Any]:
        """Controllers of genes ``(N, D)``, each from 0 to 1."""
        return controllers(self.space, genes)

    def changed(self, mind: MindT) -> None:
        """The newest trial was the first of a robot that is another one.

        What was deployed is tried first: it may work still.
        """
        best = int(mind.seen.argmax())
        if best < len(mind.seen) - 1:
            mind.waiting = mind.tests[[best]]
        mind.forget(newest=1)

    def prepare(self, mind: MindT, desk: Desk) -> None:
        """Evolve, as far as the desk's evaluations go."""
        self.evolve(mind, desk)

    def evolve(self, mind: MindT, desk: Desk, damages: Sequence[Damage] = ()) -> None:
        """Generations in the model until the desk's evaluations are spent.

        Args:
            mind: whose population.
            desk: to think at.
            damages: the one that the model's robot has, if any.
        """
        while desk.room:
            count = min(self.rule.population, desk.room)
            fresh = not len(mind.genes)
            genes = desk.random(count) if fresh else bred(mind.genes, count, desk.rng)
            trials = desk.run(genes, [*damages] * count)
            self.add(mind, genes, trials)
            mind.keep(self.survivors(mind)[: self.rule.population])

    def add(self, mind: MindT, genes: np.ndarray, trials: Sequence[Trial]) -> None:
        """Put controllers that the model ran into a population.

        Args:
            mind: whose population.
            genes: theirs, ``(N, D)``.
            trials: in the model, N.
        """
        mind.genes = np.vstack([mind.genes, genes])
        mind.worth = np.append(mind.worth, self.task.worth(trials))

    def survivors(self, mind: MindT) -> np.ndarray:
        """Rows of the population, ``(P,)``, the first to survive first."""
        return np.argsort(-mind.worth, kind="stable")

    @abstractmethod
    def chosen(self, mind: MindT, desk: Desk, trial: int) -> np.ndarray:
        """Genes to try, ``(D,)``.

        Args:
            mind: of the run.
            desk: with what is left of the trial's evaluations.
            trial: its number.
        """

    def deployed(self, mind: MindT) -> np.ndarray:
        """Genes of what a user would run now, ``(D,)``."""
        if len(mind.seen):
            return cast(np.ndarray, mind.tests[mind.seen.argmax()])
        return cast(np.ndarray, mind.genes[mind.worth.argmax()])

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del trial, best
        worth, rows = self.task.worth(tried), []
        for mind, seen, value in zip(self.minds, tried, worth, strict=True):
            rows.append(self.learn(mind, seen, float(value)))
            mind.tests = np.vstack([mind.tests, mind.tried])
            mind.seen = np.append(mind.seen, value)
            mind.forget(self.rule.remembered)
        columns = {name: np.array([row[name] for row in rows]) for name in rows[0]}
        return {"worth_seen": worth, **columns}

    @abstractmethod
    def learn(self, mind: MindT, seen: Trial, worth: float) -> dict[str, Any]:
        """Learn from a trial, before it is remembered as a test.

        Args:
            mind: of the run.
            seen: the trial.
            worth: what it achieved.

        Returns:
            The learner's own columns.
        """

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`: all that each run knows, and what models have spent."""
        found = {"spent": np.array([model.spent for model in self.models], np.int64)}
        for run, mind in enumerate(self.minds):
            found |= {f"{run}.{name}": array for name, array in vars(mind).items()}
        return found

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        for run, mind in enumerate(self.minds):
            for name in vars(mind):
                setattr(mind, name, arrays[f"{run}.{name}"].copy())
        for model, spent in zip(self.models, arrays["spent"], strict=True):
            model.spent = int(spent)
