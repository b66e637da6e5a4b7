"""Static SNN (Pretorius et al. 2009, 2013): gather, train once, evolve, transfer.

How simulator neural networks were used before BNS (thesis 2.7): random controllers are
driven in the world and the networks are trained on what they did; then a population
evolves inside them, and its best is transferred to the robot. Nothing is learned from
there on, so what it does not foresee, such as damage, it does not recover from.

The networks, the operators and the worth of controllers inside the networks are those
of BNS on the same task. Random trials are trials, and are charged like others.
"""

import math
from collections.abc import Mapping
from dataclasses import dataclass, replace
from typing import Any, ClassVar, cast

import numpy as np
import torch

from bns.errors import BnsError
from bns.evolution.chromosome import Encoding, Population
from bns.evolution.generation import Genes
from bns.experiment.config import LearnerSettings, RunConfig
from bns.learners.base import Proposal
from bns.learners.bns.learner import Bns


@dataclass(frozen=True, kw_only=True)
class StaticSnnSettings(LearnerSettings):
    """Settings of the static SNN; `evolution` and `snn` say the rest."""

    commands: int = 1000
    """random commands on which the SNN is trained, in as many trials as they take; then
    it is trained no more"""
    trainings: int = 10
    """trainings of `snn.epochs` each, one after another"""
    generations: int = 2000
    """generations inside the SNN before the transfer, in place of
    evolution.generations (thesis 5.4)"""

    bounds: ClassVar[Mapping[str, tuple[float, float, str]]] = {
        "commands": (1, 1e9, "commands"),
        "trainings": (1, 1_000_000, "trainings"),
        "generations": (0, 1_000_000, "generations"),
    }


class StaticSnn(Bns):
    """R runs of the static approach as one tensor program; arguments as `Learner`.

    Raises:
        BnsError: no trial is left for what evolves.
    """

    Settings = StaticSnnSettings
    sections = ("evolution", "snn", "compiled")

    def begin(self) -> None:
        """See `Learner.begin`.

        Raises:
            BnsError: no trial is left for what evolves.
        """
        super().begin()
        config, self.rule = self.config, cast(StaticSnnSettings, self.config.settings)
        self._encoding: Genes = self.problem.encoding
        each = config.light.cycles
        if not self.task.closed_loop:
            each = cast(Encoding, self._encoding).max_commands
        if isinstance(self._encoding, Encoding):  # random lists are of full length
            self._encoding = replace(self._encoding, initial=(each, each))
        self.random_trials = math.ceil(self.rule.commands / each)
        if self.random_trials >= config.trials:
            raise BnsError(
                f"settings.commands = {self.rule.commands} random commands take "
                f"{self.random_trials} trials and leave none of {config.trials} for "
                "what evolves: give fewer commands, or more trials."
            )

    @classmethod
    def compiles(cls, config: RunConfig) -> bool:
        """See `Learner.compiles`; it evolves once, not before every trial."""
        rule = cast(StaticSnnSettings, config.settings)
        once = replace(config.evolution, generations=rule.generations)
        return super().compiles(replace(config, trials=1, evolution=once))

    def propose(self, trial: int) -> Proposal[Any]:
        """See `Learner.propose`; random controllers, then one that evolved."""
        self._trial = trial
        if self.learns_from(trial):
            rows = len(self.population.lengths)  # of islands, where a run has some
            drawn = self._by_run(self._encoding.random(rows, 1, self.draws))
            self._chosen = drawn.pick(torch.zeros_like(drawn.lengths[:, 0]))
        elif trial == self.random_trials:
            self._transfer(trial)
        return Proposal(self.problem.controllers(self._chosen))

    def _transfer(self, trial: int) -> None:
        """Evolve inside the SNN, and choose the best."""
        self.population = self.problem.random()
        self.cost = self.problem.cost(self.memories, self.population)
        self._evolve(trial, self.rule.generations)
        best = self.cost.reshape(self.runs, -1).argmin(1)
        self._chosen = self._by_run(self.population).pick(best)

    def learns_from(self, trial: int) -> bool:
        """See `Bns.learns_from`; random trials alone."""
        return trial < self.random_trials

    def _train(self, row: dict[str, np.ndarray]) -> None:
        if self._trial == self.random_trials - 1:
            for _ in range(self.rule.trainings):
                super()._train(row)

    def run_in_background(self) -> None:
        """See `Learner.run_in_background`; it thinks once, before the transfer."""

    def think(self) -> bool:
        """See `Learner.think`."""
        return False

    def state(self) -> dict[str, np.ndarray]:
        """See `Learner.state`."""
        genes, lengths = (part.cpu().numpy() for part in self._chosen)
        return {**super().state(), "chosen.genes": genes, "chosen.lengths": lengths}

    def restore(self, arrays: Mapping[str, np.ndarray]) -> None:
        """See `Learner.restore`."""
        super().restore(arrays)
        names = ("chosen.genes", "chosen.lengths")
        genes, lengths = (torch.from_numpy(arrays[name].copy()) for name in names)
        device = self.config.device
        self._chosen = Population(genes.to(device), lengths.to(device))


LEARNER = StaticSnn
