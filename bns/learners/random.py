"""Random search: another random controller in every trial, the best one kept.

The floor that any learner has to beat. It is told nothing of damage, and what it keeps
may be of a robot that is no more: `fitness_best` says what that is worth now.
"""

from collections.abc import Mapping, Sequence
from typing import Any, ClassVar

import numpy as np

from bns import seeding
from bns.learners.base import Curves, Learner, Panel, Proposal
from bns.worlds.trial import Trial

BEST_SEEN = Curves(
    name="best_seen",
    title="Lowest cost so far",
    caption="The lowest cost that each run has seen in the world until then. {band}",
    label="lowest cost seen",
    panels=(Panel("best_seen", "all trials until then"),),
)


class RandomSearch(Learner):
    """R runs of random search; arguments as `Learner`."""

    columns: ClassVar[Mapping[str, str]] = {"best_seen": "lowest cost in the world yet"}
    figures = (BEST_SEEN,)

    def begin(self) -> None:
        """See `Learner.begin`."""
        self._space = self.task.space
        self.tried = np.zeros((self.runs, self._space.size))
        self.best = self.tried.copy()
        self.cost = np.full(self.runs, np.inf)

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`."""
        seed = self.config.seed
        for run, replicate in enumerate(self.replicates):
            rng = seeding.generator(seed, "random", replicate, trial)
            self.tried[run] = self._space.random(1, rng)[0]
        tried = self._space.controllers(self.tried)
        if not np.isfinite(self.cost).all():
            return Proposal(tried)
        return Proposal(tried, self._space.controllers(self.best))

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del trial, best
        cost = self.task.fitness(tried)
        better = cost < self.cost
        self.cost = np.where(better, cost, self.cost)
        self.best = np.where(better[:, None], self.tried, self.best)
        return {"best_seen": self.cost.copy()}

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        return {"best": self.best.copy(), "cost": self.cost.copy()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self.best, self.cost = arrays["best"].copy(), arrays["cost"].copy()


LEARNER = RandomSearch
