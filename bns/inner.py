"""The learner's two inner loops, evolution and training, eager or compiled.

Where a C++ compiler exists and the run is long enough to pay for it, the generation
and the epoch are compiled as a whole; the results agree with eager ones to rounding,
and the record says which ran.
"""

import shutil
from collections.abc import Callable
from functools import partial

import torch
from torch import Tensor

from bns.chromosome import Population
from bns.config import RunConfig
from bns.draws import Draws
from bns.errors import MissingDependencyError
from bns.evaluation import Evaluator
from bns.evolution.generation import Breeder, Rates
from bns.snn import training
from bns.snn.network import forward

WORTH_COMPILING = 40_000  # generations of all trials; compiling takes some 30 s


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
        return compiler is not None and work >= WORTH_COMPILING * 30 // 10
    return config.compiled == "yes"


class InnerLoops:
    """Evolution and training of R runs."""

    def __init__(self, config: RunConfig, evaluator: Evaluator, breeder: Breeder):
        self.config = config
        self.evaluator = evaluator
        self.breeder = breeder
        self.compiled = should_compile(config)
        self._cost: Callable[..., Tensor] = self._cost_of
        self._epoch = partial(training.epoch, evaluator.shape)
        if self.compiled:
            torch._dynamo.config.cache_size_limit = 64
            self._cost = torch.compile(self._cost_of, dynamic=False)
            self._epoch = torch.compile(self._epoch, dynamic=False)

    def _cost_of(self, theta: Tensor, genes: Tensor, lengths: Tensor) -> Tensor:
        return self.evaluator.cost(theta, Population(genes, lengths))

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost ``(R, P)``."""
        return self._cost(theta, population.genes, population.lengths)

    def evolve(
        self, theta: Tensor, population: Population, cost: Tensor, rates: Rates
    ) -> tuple[Population, Tensor]:
        """All generations between two trials; gives the population and its costs."""
        for _ in range(self.config.evolution.generations):
            population = self.breeder.breed(population, cost, rates)
            cost = self.cost(theta, population)
        return population, cost

    def train(
        self,
        theta: Tensor,
        inputs: Tensor,
        targets: Tensor,
        weight: Tensor,
        draws: Draws,
    ) -> tuple[Tensor, Tensor]:
        """Train the SNNs; gives the weights and the mean squared error ``(R,)``."""
        shape = self.evaluator.shape
        shaped = targets.unsqueeze(2) if shape.outputs == 1 else targets.unsqueeze(1)
        keep = None
        if self.config.snn.kind == "ensemble" and self.config.snn.dropout > 0:
            keep = partial(self._dropout, draws, inputs.shape)
        state = training.RpropState.fresh(theta)
        for _ in range(self.config.snn.epochs):
            factors = keep() if keep is not None else None
            theta, state = self._epoch(theta, state, inputs, shaped, weight, factors)
        error = (forward(shape, theta, inputs) - shaped) * weight
        patterns = weight.sum((1, 2, 3)).clamp(min=1.0)
        heads = shape.groups * shape.outputs
        return theta, error.square().sum((1, 2, 3)) / (patterns * heads)

    def _dropout(self, draws: Draws, size: torch.Size) -> Tensor:
        shape, rate = self.evaluator.shape, self.config.snn.dropout
        coins = draws.uniform(size[0], shape.groups, shape.hidden, size[2])
        return (coins >= rate).float() / (1.0 - rate)
