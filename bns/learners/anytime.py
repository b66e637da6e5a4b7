"""Anytime learning (Parker 2000): evolves in a model whose numbers evolve, too.

The best, the worst and any one of the population are tried on the robot in turn. What
differs between where they end there and where they end in the model is what guesses at
the model's numbers are judged by. Controllers evolve in the best guess, and there is
something to use at any time.
"""

from collections.abc import Sequence

import numpy as np

from bns.prior.modelling import Modeller, ModellingMind, places
from bns.prior.thinking import Desk
from bns.worlds.trial import Trial


class Anytime(Modeller):
    """R runs of anytime learning; arguments as `Learner`."""

    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Modeller.clues`: the last pose."""
        ends = [places([trial])[0, -1] for trial in trials]
        return np.stack(ends)

    def chosen(self, mind: ModellingMind, desk: Desk, trial: int) -> np.ndarray:
        """See `Thinker.chosen`: the best, the worst, any one, in turn."""
        last = len(mind.genes) - 1
        row = (0, last, int(desk.rng.integers(last + 1)))[trial % 3]
        return np.array(mind.genes[row])


LEARNER = Anytime
