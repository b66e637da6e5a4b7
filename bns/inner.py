"""The learner's two inner loops, evolution and training, eager or compiled.

Where a C++ compiler exists and the run is long enough to pay for it, the generation
and the epoch are compiled as a whole; the results agree with eager ones to rounding,
and the record says which ran.
"""

import shutil
from functools import partial

import torch
from torch import Tensor

from bns.chromosome import Population
from bns.draws import Draws
from bns.errors import MissingDependencyError
from bns.evaluation import Evaluator
from bns.evolution.generation import Breeder, Coins, Rates
from bns.experiment.config import RunConfig
from bns.learners.registry import dearness
from bns.snn import fitting

WORTH_COMPILING = 120_000  # generations of all trials; compiling takes some 30 s


def should_compile(config: RunConfig) -> bool:
    """Whether a run is compiled.

    Raises:
        MissingDependencyError: asked for, but there is no C++ compiler.
    """
    compiler = shutil.which("g++") or shutil.which("clang++") or shutil.which("c++")
    if config.compiled == "yes" and compiler is None:
        raise MissingDependencyError(
            "compiled = 'yes'", "a C++ compiler", "apt-get install g++"
        )
    if config.compiled == "auto":
        work = config.trials * config.evolution.generations * config.replicates
        work *= dearness(config.learner)
        return compiler is not None and work >= WORTH_COMPILING
    return config.compiled == "yes"


class InnerLoops:
    """Evolution and training of R runs.

    Args:
        config: the runs' configuration.
        evaluator: what a population is worth inside the SNN.
        breeder: makes the next generation.
        draws: source of randomness, shared with the learner.
    """

    def __init__(
        self,
        config: RunConfig,
        evaluator: Evaluator,
        breeder: Breeder,
        draws: Draws,
    ):
        self.config = config
        self.evaluator = evaluator
        self.breeder = breeder
        self.draws = draws
        self._breed, self._judge = self._bred, self.evaluator.judge
        self._epoch = fitting.epoch_of(evaluator.shape, config.snn)
        if should_compile(config):
            torch._dynamo.config.cache_size_limit = 64
            judge = partial(self.evaluator.judge, fused=True)
            # two regions: in one, the compiler would compute the inputs anew for
            # every hidden neuron
            self._breed = torch.compile(self._bred, dynamic=False)
            self._judge = torch.compile(judge, dynamic=False)
            self._epoch = torch.compile(self._epoch, dynamic=False)

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost ``(R, P)``."""
        return self.evaluator.cost(theta, population)

    def _bred(
        self, population: Population, cost: Tensor, rates: Rates, coins: Coins
    ) -> tuple[Population, Tensor]:
        bred = self.breeder.breed(population, cost, rates, coins)
        return bred, self.evaluator.inputs(bred)

    def evolve(
        self, theta: Tensor, population: Population, cost: Tensor, rates: Rates
    ) -> tuple[Population, Tensor]:
        """All generations between two trials; gives the population and its costs."""
        for _ in range(self.config.evolution.generations):
            coins = self.breeder.draw(self.draws, rates)
            population, inputs = self._breed(population, cost, rates, coins)
            cost = self._judge(theta, inputs, population.lengths)
        return population, cost

    def train(
        self, theta: Tensor, inputs: Tensor, targets: Tensor, weight: Tensor
    ) -> tuple[Tensor, Tensor]:
        """Train the SNNs from fresh step sizes.

        Args:
            theta: weights ``(R, D)``.
            inputs: scaled inputs ``(R, 5, N)``.
            targets: scaled displacements ``(R, 3, N)``.
            weight: 1 for a pattern, 0 for padding, ``(R, 1, 1, N)``.

        Returns:
            new weights, and the mean squared error after training ``(R,)``.
        """
        return fitting.fit(
            self.evaluator.shape,
            self.config.snn,
            theta,
            fitting.Patterns(inputs, targets, weight),
            self.draws,
            self._epoch,
        )
