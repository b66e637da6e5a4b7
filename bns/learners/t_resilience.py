"""T-Resilience (Koos, Cully and Mouret 2013): recovers by a model that stays intact.

The transferability approach without looking for what is wrong: the self-model stays
that of the undamaged robot, and what is learned is by how much less controllers achieve
on the robot than in it, from tests of any member of the population. What the damage
does not touch is what transfers.
"""

from dataclasses import dataclass

import numpy as np

from bns.learners.transferability import (
    Transferability,
    TransferMind,
    TransferSettings,
)
from bns.prior.thinking import Desk
from bns.worlds.trial import Trial


@dataclass(frozen=True, kw_only=True)
class TResilienceSettings(TransferSettings):
    """Settings of T-Resilience; tests as in Koos et al. 2013."""

    tests: int = 25
    """tests on a robot, of any member of the population"""


class TResilience(Transferability):
    """R runs of T-Resilience; arguments as `Learner`."""

    Settings = TResilienceSettings

    def differs(self, mind: TransferMind, seen: Trial, worth: float) -> float:
        """See `Transferability.differs`: in what was achieved.

        Args:
            mind: with what was foreseen.
            seen: the trial.
            worth: of it.
        """
        del seen
        return abs(float(mind.foreseen[0]) - worth)

    def told_most(self, mind: TransferMind, does: np.ndarray, desk: Desk) -> int:
        """See `Transferability.told_most`: any one.

        Args:
            mind: of the run.
            does: of those to choose from, ``(N, F)``.
            desk: to think at.
        """
        del mind
        return int(desk.rng.integers(len(does)))

    def hoped(self, mind: TransferMind, row: int) -> float:
        """What a member of the population may achieve: less than in the model."""
        less = self.expected(mind, mind.done[[row]])[0]
        return float(mind.worth[row] - less)


LEARNER = TResilience
