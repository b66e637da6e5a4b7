"""CMA-ES (Hansen 2016) on the controllers themselves, one candidate a trial.

Direct evolution where there is no model: a generation takes as many trials as it has
candidates. With a prior (`prior.world`) it evolves in that model first, until its
evaluations are spent, and tries the best it found: the ceiling of what a model of the
undamaged robot can give, and of thousands of trials.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import Any, ClassVar, cast

import numpy as np

from bns import seeding
from bns.errors import MissingDependencyError, install
from bns.experiment.config import LearnerSettings
from bns.learners.base import Learner, Proposal
from bns.learners.random import BEST_SEEN
from bns.tasks.base import Space
from bns.worlds.trial import Trial


@dataclass(frozen=True, kw_only=True)
class CmaSettings(LearnerSettings):
    """Settings of CMA-ES."""

    sigma: float = 0.2
    """first step size, as a share of the range of each number"""
    population: int = 0
    """candidates of a generation; 0 = 4 + 3 ln D"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "sigma": (1e-6, 10, "1"),
        "population": (0, 100_000, "candidates"),
    }


class Search:
    """One run of CMA-ES; costs alone bring it to where it was.

    Args:
        settings: of CMA-ES.
        space: in which it begins in the middle of random controllers.
        rng: of all that it draws.
    """

    def __init__(self, settings: CmaSettings, space: Space, rng: np.random.Generator):
        try:
            import cma
        except ImportError:
            raise MissingDependencyError(
                "learner = 'cma'", "cma", install("cma")
            ) from None
        options = {
            "bounds": [0, 1],
            "seed": np.nan,  # nothing global is seeded
            "randn": lambda *shape: rng.standard_normal(shape),
            "verbose": -9,
            "popsize": settings.population or None,
        }
        options = {name: value for name, value in options.items() if value is not None}
        self._low, self._width = space.low, np.maximum(space.high - space.low, 1e-12)
        middle = (space.first_low + space.first_high) / 2
        start = ((middle - space.low) / self._width).clip(0, 1)  # in the unit cube
        self._es = cma.CMAEvolutionStrategy(start, settings.sigma, options)
        self.costs: list[float] = []
        self._best, self.cost = start, np.inf
        self._ask()

    def _ask(self) -> None:
        self._asked = [np.asarray(x) for x in self._es.ask()]
        self._heard: list[float] = []

    @property
    def size(self) -> int:
        """Candidates of a generation."""
        return int(self._es.popsize)

    @property
    def generation(self) -> np.ndarray:
        """Candidates that were not told yet, ``(N, D)``."""
        return self._low + np.stack(self._asked[len(self._heard) :]) * self._width

    @property
    def best(self) -> np.ndarray:
        """Candidate of the lowest cost yet, ``(D,)``; at first the middle."""
        vector: np.ndarray = self._low + self._best * self._width
        return vector

    def tell(self, cost: float) -> None:
        """The cost of the first candidate of `generation`; lower is better."""
        self.costs.append(cost)
        if cost < self.cost:
            self._best, self.cost = self._asked[len(self._heard)], cost
        self._heard.append(cost)
        if len(self._heard) == len(self._asked):
            self._es.tell(self._asked, self._heard)
            self._ask()

    @property
    def sigma(self) -> float:
        """Step size now."""
        return float(self._es.sigma)


class CmaEs(Learner):
    """R runs of CMA-ES; arguments as `Learner`."""

    Settings = CmaSettings
    columns: ClassVar[Mapping[str, str]] = {
        "best_seen": "lowest cost yet, of the model's evaluations, too",
        "sigma": "step size, as a share of the range of each number",
    }
    figures = (BEST_SEEN,)

    def begin(self) -> None:
        """See `Learner.begin`."""
        settings, space = cast(CmaSettings, self.config.settings), self.task.space
        self.searches = [
            Search(settings, space, seeding.generator(self.config.seed, "cma", run))
            for run in self.replicates
        ]

    def _evolve_in_models(self) -> None:
        """Whole generations in each run's model, as long as there are evaluations."""
        runs = zip(self.replicates, self.searches, self.models, strict=True)
        for replicate, search, model in runs:
            while model.left >= search.size:
                tried = self.task.space.controllers(search.generation)
                names = ("cma-model", replicate, model.spent)
                seed = seeding.integer(self.config.seed, *names)
                seeds = [seed + number for number in range(len(tried))]
                trials = self.task.execute(model, tried, trial=0, seeds=seeds)
                for cost in self.task.fitness(trials):
                    search.tell(float(cost))

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`; with a prior, the model's best comes first."""
        if trial == 0 and self.models:
            self._evolve_in_models()
            return Proposal(self._best())
        tried = np.stack([search.generation[0] for search in self.searches])
        controllers = self.task.space.controllers(tried)
        return Proposal(controllers, self._best() if trial > 0 else None)

    def _best(self) -> list[Any]:
        bests = np.stack([search.best for search in self.searches])
        return self.task.space.controllers(bests)

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del best
        if trial > 0 or not self.models:
            costs = self.task.fitness(tried)
            for search, cost in zip(self.searches, costs, strict=True):
                search.tell(float(cost))
        return {
            "best_seen": np.array([search.cost for search in self.searches]),
            "sigma": np.array([search.sigma for search in self.searches]),
        }

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`: the costs that were told, and what models have spent."""
        return {
            "costs": np.array([search.costs for search in self.searches]),
            **self.spent(),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self.begin()
        for search, costs in zip(self.searches, arrays["costs"], strict=True):
            for cost in costs:
                search.tell(float(cost))
        self.restore_spent(arrays)


LEARNER = CmaEs
