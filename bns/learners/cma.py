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
    """One run of CMA-ES in the unit cube; costs alone bring it to where it was.

    Args:
        settings: of CMA-ES.
        start: where it begins, ``(D,)``, each from 0 to 1.
        rng: of all that it draws.
    """

    def __init__(
        self, settings: CmaSettings, start: np.ndarray, rng: np.random.Generator
    ):
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
        self._es = cma.CMAEvolutionStrategy(start, settings.sigma, options)
        self.costs: list[float] = []
        self.best, self.cost = start, np.inf
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
        return np.stack(self._asked[len(self._heard) :])

    def tell(self, cost: float) -> None:
        """The cost of the first candidate of `generation`; lower is better."""
        self.costs.append(cost)
        if cost < self.cost:
            self.best, self.cost = self._asked[len(self._heard)], cost
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
        settings = cast(CmaSettings, self.config.settings)
        space = self.task.space
        self._space, self._range = space, np.maximum(space.high - space.low, 1e-12)
        middle = (space.first_low + space.first_high) / 2
        start = ((middle - space.low) / self._range).clip(0, 1)
        self.searches = [
            Search(settings, start, seeding.generator(self.config.seed, "cma", run))
            for run in self.replicates
        ]

    def _controllers(self, units: Sequence[np.ndarray] | np.ndarray) -> list[Any]:
        vectors = self._space.low + np.asarray(units) * self._range
        return self._space.controllers(vectors)

    def _evolve_in_models(self) -> None:
        """Whole generations in each run's model, as long as there are evaluations."""
        runs = zip(self.replicates, self.searches, self.models, strict=True)
        for replicate, search, model in runs:
            while model.left >= search.size:
                tried = self._controllers(search.generation)
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
            return Proposal(self._controllers([s.best for s in self.searches]))
        tried = self._controllers([s.generation[0] for s in self.searches])
        if trial == 0:
            return Proposal(tried)
        return Proposal(tried, self._controllers([s.best for s in self.searches]))

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
            "spent": np.array([model.spent for model in self.models], np.int64),
        }

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self.begin()
        for search, costs in zip(self.searches, arrays["costs"], strict=True):
            for cost in costs:
                search.tell(float(cost))
        for model, spent in zip(self.models, arrays["spent"], strict=True):
            model.spent = int(spent)


LEARNER = CmaEs
