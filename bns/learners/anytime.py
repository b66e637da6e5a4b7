"""Anytime learning (Parker 2000): evolves in a model whose numbers evolve, too.

The best, the worst and any one of the population are tried on the robot in turn. What
differs between where they end there and where they end in the model is what guesses at
the model's numbers are judged by. Controllers evolve in the best guess, and there is
something to use at any time.
"""

from collections.abc import Sequence

import numpy as np

from bns.prior.model_learner import Rollouts
from bns.prior.modelling import Modeller, ModellingMemory, places
from bns.worlds.trial import Trial


class Anytime(Modeller):
    """R runs of anytime learning; arguments as `Learner`."""

    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Modeller.clues`: the last pose."""
        ends = [places([trial])[0, -1] for trial in trials]
        return np.stack(ends)

    def chosen(
        self, memory: ModellingMemory, rollouts: Rollouts, trial: int
    ) -> np.ndarray:
        """See `ModelLearner.chosen`: the best, the worst, any one, in turn."""
        last = len(memory.genes) - 1
        row = (0, last, int(rollouts.rng.integers(last + 1)))[trial % 3]
        return np.array(memory.genes[row])


LEARNER = Anytime
