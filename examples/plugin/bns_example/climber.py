"""Hill climbing: small changes to the best controller so far, kept where they help."""

from collections.abc import Mapping, Sequence
from typing import Any

import numpy as np

from bns import seeding
from bns.learners.base import Learner, Proposal
from bns.worlds.trial import Trial

STEP = 0.1
"""standard deviation of a change, as a share of what is usual between controllers"""


class Climber(Learner):
    """R runs of hill climbing; arguments as `Learner`."""

    def begin(self) -> None:
        """See `Learner.begin`."""
        self.best = np.zeros((self.runs, self.task.space.size))
        self.tried = self.best.copy()
        self.cost = np.full(self.runs, np.inf)

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`."""
        space = self.task.space
        for run, replicate in enumerate(self.replicates):
            rng = seeding.generator(self.config.seed, "climber", replicate, trial)
            fresh = space.random(2, rng)
            if np.isfinite(self.cost[run]):
                self.tried[run] = self.best[run] + STEP * (fresh[0] - fresh[1])
            else:
                self.tried[run] = fresh[0]
        return Proposal(space.controllers(self.tried))

    def observe(
        self, trial: int, tried: Sequence[Trial], best: Sequence[Trial] | None
    ) -> dict[str, np.ndarray]:
        """See `Learner.observe`."""
        del trial, best
        cost = self.task.fitness(tried)
        better = cost < self.cost
        self.cost = np.where(better, cost, self.cost)
        self.best = np.where(better[:, None], self.tried, self.best)
        return {}

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        return {"best": self.best.copy(), "cost": self.cost.copy()}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        self.best, self.cost = arrays["best"].copy(), arrays["cost"].copy()
