"""Back to reality (Zagal et al. 2004): fits its model to differences of worth alone.

Of the best controllers of the population one after another is tried on the robot. The
model's numbers are evolved until controllers achieve in the model what they achieve on
the robot, whatever way they go; controllers are evolved on in that model.
"""

from collections.abc import Sequence

import numpy as np

from bns.prior.modelling import Modeller, ModellingMind
from bns.prior.thinking import Desk
from bns.worlds.trial import Trial


class BackToReality(Modeller):
    """R runs of back-to-reality; arguments as `Learner`."""

    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Modeller.clues`: what each achieved, and nothing else."""
        return self.task.worth(trials)[:, None]

    def chosen(self, mind: ModellingMind, desk: Desk, trial: int) -> np.ndarray:
        """See `Thinker.chosen`: the best one that was not tried yet."""
        del desk, trial
        fresh = np.flatnonzero(mind.untested)
        return np.array(mind.genes[fresh[0] if len(fresh) else 0])


LEARNER = BackToReality
