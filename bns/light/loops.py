"""The learner's inner loops: judging in closed loop, evolution, training.

Where a run is compiled, one cycle of all robots is one compiled region, and so is an
epoch of training; see `bns.inner`.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from bns.chromosome import Population
from bns.draws import Draws, whole_below
from bns.evolution.generation import Breeder, Rates
from bns.evolution.mutation import normal
from bns.experiment.config import RunConfig
from bns.inner import should_compile
from bns.light.simulator import Noise, Simulator, State, Thetas
from bns.light.task import LightTask
from bns.snn import fitting


class Snns(NamedTuple):
    """The SNNs of R runs: their weights, and what they err by.

    Attributes:
        thetas: weights.
        spread: RMS error of each scaled output on the patterns, ``(R, 3)``, ``(R, 2)``.
    """

    thetas: Thetas
    spread: Thetas


class LightLoops:
    """Evolution and training of R runs.

    Args:
        config: what the runs share.
        simulator: the SNNs' shapes and what they stand for.
        breeder: makes the next generation of every island.
        draws: source of randomness, shared with the learner.
    """

    def __init__(
        self, config: RunConfig, simulator: Simulator, breeder: Breeder, draws: Draws
    ):
        self.config, self.simulator = config, simulator
        self.breeder, self.draws = breeder, draws
        pool = LightTask.of(config.light).start_pool()
        self._pool = torch.from_numpy(pool).float().to(config.device)
        self._advance = simulator.advance
        self._epochs = {
            shape: fitting.epoch_of(shape, config.snn)
            for shape in (simulator.motion, simulator.sensors)
        }
        if should_compile(config):
            torch._dynamo.config.cache_size_limit = 64
            self._advance = torch.compile(simulator.advance, dynamic=False)
            self._epochs = {
                shape: torch.compile(epoch, dynamic=False)
                for shape, epoch in self._epochs.items()
            }

    def starts(self, runs: int) -> Tensor:
        """Random starts, shared by all individuals of a run: ``(R, S, 2)`` [m]."""
        coins = self.draws.uniform(runs, self.config.light.starts)
        return self._pool[whole_below(coins, len(self._pool))]

    def noise(self, spread: Thetas) -> list[Noise] | list[None]:
        """Normal noise of every cycle, shared by all individuals of a run.

        Args:
            spread: what the SNNs err by on their patterns, ``(R, 3)`` and ``(R, 2)``.
        """
        light = self.config.light
        if light.noise == 0:
            return [None] * light.cycles
        drawn = []
        for part in spread:
            runs, outputs = part.shape
            coins = self.draws.uniform(light.cycles, runs, outputs, light.starts, 1)
            scale = light.noise * part[:, :, None, None]
            drawn.append(normal(coins) * scale)
        return [Noise(*pair) for pair in zip(*drawn, strict=True)]

    def _begin(self, genomes: Tensor) -> tuple[tuple[Tensor, ...], State]:
        """Controllers of genomes ``(R, P, D)``, and their robots at fresh starts."""
        runs, count, _ = genomes.shape
        starts = self.starts(runs).unsqueeze(-1).expand(-1, -1, -1, count)
        ahead, left = starts[:, :, 0].contiguous(), starts[:, :, 1].contiguous()
        layers = self.simulator.controllers.layers(genomes)
        return layers, self.simulator.begin(ahead, left)

    def cost(self, snns: Snns, genomes: Tensor) -> Tensor:
        """Predicted cost ``(R, P)`` of genomes ``(R, P, D)`` from fresh starts."""
        layers, state = self._begin(genomes)
        for noise in self.noise(snns.spread):
            state = self._advance(snns.thetas, layers, state, noise)
        return (state.error / state.begun).mean(1)

    def disagreement(self, thetas: Thetas, population: Population) -> Tensor:
        """How far ensembles disagree on the way from fresh starts, ``(R, P)``.

        Args:
            thetas: weights of the SNNs.
            population: genomes ``(R, P, D, 1)``, the islands of a run side by side.
        """
        layers, state = self._begin(population.genes.squeeze(-1))
        total = torch.zeros_like(state.error)
        for _ in range(self.config.light.cycles):
            after = self._advance(thetas, layers, state, None)
            total += self.simulator.doubt(thetas, state, after)
            state = after
        return total.mean(1)

    def cost_of(self, snns: Snns, population: Population) -> Tensor:
        """The same of a population whose rows are islands, ``(R I, p)``."""
        rows, size = population.lengths.shape
        runs = len(snns.thetas.motion)
        genomes = population.genes.reshape(runs, -1, population.genes.shape[2])
        return self.cost(snns, genomes).reshape(rows, size)

    def evolve(
        self, snns: Snns, population: Population, cost: Tensor, rates: Rates
    ) -> tuple[Population, Tensor]:
        """All generations between two trials; gives the population and its costs."""
        limit = self.config.light.weight_limit
        for _ in range(self.config.evolution.generations):
            coins = self.breeder.draw(self.draws, rates)
            population = self.breeder.breed(population, cost, rates, coins)
            genes = population.genes.clamp(-limit, limit)  # SBX spreads without end
            population = population._replace(genes=genes)
            cost = self.cost_of(snns, population)
        return population, cost

    def train(self, shape, theta: Tensor, patterns) -> tuple[Tensor, Tensor]:
        """Fit stacked networks of a shape to patterns, see `bns.snn.fitting.fit`."""
        return fitting.fit(
            shape, self.config.snn, theta, patterns, self.draws, self._epochs[shape]
        )
