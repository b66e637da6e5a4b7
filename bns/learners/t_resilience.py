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
    TransferMemory,
    TransferSettings,
)
from bns.prior.model_learner import Rollouts
from bns.worlds.trial import Trial


@dataclass(frozen=True, kw_only=True)
class TResilienceSettings(TransferSettings):
    """Settings of T-Resilience; tests as in Koos et al. 2013."""

    tests: int = 25
    """tests on a robot, of any member of the population"""


class TResilience(Transferability):
    """R runs of T-Resilience; arguments as `Learner`."""

    Settings = TResilienceSettings

    def differs(self, memory: TransferMemory, seen: Trial, worth: float) -> float:
        """See `Transferability.differs`: in what was achieved.

        Args:
            memory: with what was foreseen.
            seen: the trial.
            worth: of it.
        """
        del seen
        return abs(float(memory.foreseen[0]) - worth)

    def told_most(
        self, memory: TransferMemory, does: np.ndarray, rollouts: Rollouts
    ) -> int:
        """See `Transferability.told_most`: any one.

        Args:
            memory: of the run.
            does: of those to choose from, ``(N, F)``.
            rollouts: which the model may run.
        """
        del memory
        return int(rollouts.rng.integers(len(does)))

    def hoped(self, memory: TransferMemory, row: int) -> float:
        """What a member of the population may achieve: less than in the model."""
        less = self.expected(memory, memory.done[[row]])[0]
        return float(memory.worth[row] - less)


LEARNER = TResilience
