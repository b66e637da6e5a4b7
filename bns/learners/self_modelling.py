"""Self-modelling (Bongard, Zykov and Lipson 2006): asks what its models dispute.

Fifteen models of the robot explain what was seen. In each of the first `rounds` trials
of a robot the controller is tried on which they disagree most, which tells most of them
apart; models are evolved on all of it. Then controllers are evolved in the best model,
and the best one is tried.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from typing import ClassVar

import numpy as np

from bns.prior.model_learner import Rollouts
from bns.prior.modelling import Modeller, ModellingMemory, ModellingSettings, places
from bns.worlds.trial import Trial


@dataclass(frozen=True, kw_only=True)
class SelfModellingSettings(ModellingSettings):
    """Settings of self-modelling; models and rounds as in Bongard et al. 2006."""

    first: int = 300
    """see ModelLearnerSettings"""
    each: int = 70
    """see ModelLearnerSettings"""
    guesses: int = 15
    """models that are kept"""
    rounds: int = 15
    """tests of a robot that are chosen to tell models apart"""
    candidates: int = 4
    """random controllers of which one is such a test"""
    jury: int = 5
    """models, the best ones, whose disagreement counts; the original: all"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        **ModellingSettings.bounds,
        "rounds": (0, 10_000, "tests"),
        "candidates": (1, 10_000, "controllers"),
        "jury": (2, 10_000, "models"),
    }


class SelfModelling(Modeller):
    """R runs of self-modelling; arguments as `Learner`."""

    Settings = SelfModellingSettings

    def clues(self, trials: Sequence[Trial]) -> np.ndarray:
        """See `Modeller.clues`: the pose after every command."""
        return places(trials, self.longest).reshape(len(trials), -1)

    @property
    def longest(self) -> int:
        """Commands of the longest list."""
        controller, walk = self.config.controller, self.config.walk
        return max(controller.max_commands, walk.commands)

    def exploring(self, memory: ModellingMemory) -> bool:
        """Whether the next test is to tell models apart."""
        return 0 < len(memory.seen) < self.rule.rounds

    def prepare(self, memory: ModellingMemory, rollouts: Rollouts) -> None:
        """See `ModelLearner.prepare`; while it explores no controllers are evolved."""
        if not self.exploring(memory):
            super().prepare(memory, rollouts)
            return
        self.fit(memory, rollouts, self.rule.candidates * self.rule.jury)

    def chosen(
        self, memory: ModellingMemory, rollouts: Rollouts, trial: int
    ) -> np.ndarray:
        """See `ModelLearner.chosen`: what models dispute, or the best one."""
        del trial
        jury = self.rule.jury
        count = min(self.rule.candidates, rollouts.room // jury)
        if not self.exploring(memory) or count < 1 or not len(memory.guesses):
            return np.array(memory.genes[0])
        genes = rollouts.random(count)
        points = memory.guesses[np.argsort(memory.miss, kind="stable")[:jury]]
        damages = self.unknowns.damages(np.repeat(points, count, axis=0))
        made = self.clues(rollouts.run(np.tile(genes, (len(points), 1)), damages))
        spread = np.nan_to_num(made).reshape(len(points), count, -1).var(0).mean(1)
        return np.array(genes[spread.argmax()])


LEARNER = SelfModelling
