"""Domain randomisation (Tobin et al. 2017): one policy, trained on damage at random.

In light following. Before the first trial a policy is trained in a model
(`prior.world light`) whose robots have something wrong with them, drawn anew for each
generation from a declared range. It is then driven as it is: no trial teaches it
anything, and it is never told of damage.

What trains it is a setting of the method, and here CMA-ES on its weights. All
candidates of a generation meet the same situations: a damage and a start each.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.experiment.config import LearnerSettings
from bns.learners.base import Curves, Panel, Proposal, RememberingLearner
from bns.learners.cma import CmaSettings, Search
from bns.prior.modelling import Unknowns
from bns.tasks.base import Space
from bns.tasks.light import LightTask
from bns.worlds.trial import Trial
from bns.worlds.world import CountedWorld

BATCH = 64
"""robots that the model drives at once, for the sake of memory"""


@dataclass(frozen=True, kw_only=True)
class RandomisedSettings(LearnerSettings):
    """Settings of a policy trained on robots damaged at random."""

    unknown: tuple[str, ...] = ()
    """what may be wrong, as effects with a range, wheel_gain:wheel=left,factor=0.5..1;
    empty = what the task says"""
    random: bool = True
    """False: it is trained on the undamaged robot alone, to compare with"""
    sigma: float = 0.05
    """first step size of CMA-ES, as a share of the range of each weight"""
    population: int = 14
    """candidates of a generation"""
    situations: int = 2
    """damages and starts that each of them meets, the first one undamaged"""
    finalists: int = 6
    """bests of the last generations among which the policy is chosen"""
    judged: int = 40
    """situations that each of these meets"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "sigma": (1e-6, 10, "1"),
        "population": (4, 100_000, "candidates"),
        "situations": (1, 10_000, "situations"),
        "finalists": (1, 10_000, "candidates"),
        "judged": (1, 10_000, "situations"),
    }


class Trained:
    """What one run knows; all attributes are arrays.

    Attributes:
        policy: as numbers, ``(D,)``; D is 0 before it is trained.
        cost: mean cost in the model, over the situations it was chosen by, ``()``.
    """

    def __init__(self) -> None:
        self.policy, self.cost = np.empty(0), np.array(np.nan)


class Situations:
    """A run's model, and what its robots meet there.

    Args:
        task: of light following.
        unknowns: what may be wrong.
        model: counted.
        rng: of all that is drawn.
        random: whether anything is wrong.
    """

    def __init__(
        self,
        task: LightTask,
        unknowns: Unknowns,
        model: CountedWorld,
        rng: np.random.Generator,
        *,
        random: bool = True,
    ):
        self.task, self.unknowns, self.model = task, unknowns, model
        self.rng, self.random = rng, random

    def draw(self, count: int) -> tuple[np.ndarray, np.ndarray]:
        """What is wrong, ``(count, P)`` from 0 to 1, and seeds ``(count,)``."""
        points = self.unknowns.random(count, self.rng)
        if not self.random:
            points[:] = self.unknowns.nominal
        return points, self.rng.integers(2**31, size=count)

    def drive(
        self, tried: Sequence[Any], points: np.ndarray, seeds: np.ndarray
    ) -> list[Trial]:
        """Drive N controllers in N situations, each charged.

        Args:
            tried: controllers.
            points: what is wrong with the robot of each, ``(N, P)``.
            seeds: of its start, ``(N,)``.
        """
        found: list[Trial] = []
        for first in range(0, len(tried), BATCH):
            part = slice(first, first + BATCH)
            world = self.model.having(self.unknowns.damages(points[part]))
            told = seeds[part].tolist()
            found += self.task.execute(world, tried[part], trial=0, seeds=told)
        return found


class DomainRandomised(RememberingLearner):
    """R runs of a policy trained beforehand; arguments as `Learner`."""

    Settings: ClassVar[type[LearnerSettings]] = RandomisedSettings
    columns: ClassVar[Mapping[str, str]] = {
        "cost_model": "mean cost of the policy in the model, over damages at random",
        "cost_seen": "cost in the world, mean of all trials until then",
    }
    figures: ClassVar[tuple[Curves | str, ...]] = (
        Curves(
            name="cost_seen",
            title="Cost of the one policy so far",
            caption="Mean of all trials until then, and what the model made of it over "
            "damages at random. {band}",
            label="cost (lower is better)",
            panels=(Panel("cost_seen", "world"), Panel("cost_model", "model")),
            shared=True,
        ),
    )
    needs_model = True
    kinds = ("light",)

    def begin(self) -> None:
        """See `Learner.begin`.

        Raises:
            BnsError: effects that cannot be, or too few evaluations.
        """
        self.rule = cast(RandomisedSettings, self.config.settings)
        self.light = cast(LightTask, self.task)
        self.unknowns = Unknowns(self.rule.unknown or self.task.unknowns)
        self.memories = [self.memory() for _ in range(self.runs)]
        self.seen = np.zeros(self.runs)
        least = self.rule.population * self.rule.situations + self._final
        if min(model.limit for model in self.models) < least:
            raise BnsError(
                f"prior.evaluations = {self.models[0].limit} is less than the {least} "
                "of one generation and the choice of the policy: give more, or fewer "
                "settings.situations, judged or finalists."
            )

    @property
    def _final(self) -> int:
        """Evaluations by which the policy is chosen."""
        return int(self.rule.finalists * self.rule.judged)

    def memory(self) -> Trained:
        """What a run knows at first."""
        return Trained()

    @property
    def space(self) -> Space:
        """Of what is searched: here the task's controllers."""
        return self.task.space

    def candidates(self, vectors: np.ndarray, points: np.ndarray) -> list[Any]:
        """Controllers of `space`'s vectors, for robots of which all is known.

        Args:
            vectors: ``(N, D)``.
            points: what is wrong with the robot of each, ``(N, P)``.
        """
        del points
        return self.space.controllers(vectors)

    def deployed(self, memory: Trained) -> Any:
        """What a run drives with in the world."""
        return self.space.controllers(memory.policy[None])[0]

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`; before the first trial policies are trained."""
        if trial == 0:
            runs = zip(self.replicates, self.models, self.memories, strict=True)
            for replicate, model, memory in runs:
                names = (self.config.learner, replicate)
                rng = seeding.generator(self.config.seed, *names)
                told = (self.light, self.unknowns, model, rng)
                self.train(memory, Situations(*told, random=self.rule.random))
        return Proposal([self.deployed(memory) for memory in self.memories])

    def train(self, memory: Trained, situations: Situations) -> None:
        """Spend the model's evaluations on a policy."""
        self.search(memory, situations, situations.model.left)

    def search(self, memory: Trained, situations: Situations, most: int) -> None:
        """Whole generations of CMA-ES, then the choice among their last bests.

        Args:
            memory: gets the policy.
            situations: of the run.
            most: evaluations that may be spent.
        """
        rule = self.rule
        settings = CmaSettings(sigma=rule.sigma, population=rule.population)
        search = Search(settings, self.space, situations.rng)
        each = rule.population * rule.situations
        bests = []
        for _ in range((most - self._final) // each):
            vectors = search.generation
            costs = self.judge(vectors, situations, rule.situations).mean(1)
            bests.append(vectors[costs.argmin()])
            for cost in costs:
                search.tell(float(cost))
        last = np.stack(bests[-rule.finalists :])
        costs = self.judge(last, situations, rule.judged).mean(1)
        memory.policy, memory.cost = last[costs.argmin()], np.array(costs.min())

    def judge(
        self, vectors: np.ndarray, situations: Situations, count: int
    ) -> np.ndarray:
        """Cost of each of N candidates in the same situations, ``(N, count)``.

        Args:
            vectors: of the candidates, ``(N, D)``.
            situations: of the run.
            count: how many are drawn.
        """
        points, seeds = situations.draw(count)
        met = np.tile(points, (len(vectors), 1))
        tried = self.candidates(np.repeat(vectors, count, axis=0), met)
        trials = situations.drive(tried, met, np.tile(seeds, len(vectors)))
        return self.task.fitness(trials).reshape(len(vectors), count)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`; nothing is learned."""
        del best
        self.seen = self.seen + self.task.fitness(tried)
        return {
            "cost_model": np.array([float(memory.cost) for memory in self.memories]),
            "cost_seen": self.seen / (trial + 1),
        }

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`; beside, the costs seen, summed, ``(R,)``."""
        return super().state() | {"seen": self.seen.copy()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        super().restore(arrays)
        self.seen = arrays["seen"].copy()


LEARNER = DomainRandomised
