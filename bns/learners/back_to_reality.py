"""Back to reality (Zagal et al. 2004): fits its model to differences of worth alone.

Of the best controllers of the population one after another is tried on the robot. The
model's numbers are evolved until controllers achieve in the model what they achieve on
the robot, whatever way they go; controllers are evolved on in that model.
"""

from collections.abc import Sequence

import numpy as np

from bns.prior.model_learner import Rollouts
from bns.prior.modelling import Modeller, ModellingMemory
from bns.worlds.trial import Trial


class BackToReality(Modeller):
    """R runs of back-to-reality; arguments as `Learner`."""

    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Modeller.clues`: what each achieved, and nothing else."""
        return self.task.worth(trials)[:, None]

    def chosen(
        self, memory: ModellingMemory, rollouts: Rollouts, trial: int
    ) -> np.ndarray:
        """See `ModelLearner.chosen`: the best one that was not tried yet."""
        del rollouts, trial
        fresh = np.flatnonzero(memory.untested)
        return np.array(memory.genes[fresh[0] if len(fresh) else 0])


LEARNER = BackToReality
