"""One generation: elites, parents, crossover, mutation (thesis Algorithm 1)."""

from dataclasses import dataclass

import torch
from torch import Tensor

from bns.chromosome import Encoding, Population
from bns.config import EvolutionConfig
from bns.draws import Draws
from bns.evolution import crossover, mutation, selection


@dataclass(frozen=True)
class Rates:
    """Mutation settings, one per run.

    Attributes:
        rate: probability per gene, ``(R,)``.
        magnitude: of each gene kind, ``(R, 3)`` [m/s, m/s, s].
    """

    rate: Tensor
    magnitude: Tensor


@dataclass(frozen=True)
class Breeder:
    """Makes the next population from the present one and its costs."""

    config: EvolutionConfig
    encoding: Encoding
    fixed_length: bool
    draws: Draws

    def breed(self, population: Population, cost: Tensor, rates: Rates) -> Population:
        """The next generation.

        Args:
            population: P individuals of R runs.
            cost: ``(R, P)``, lower is better.
            rates: mutation settings.

        Returns:
            The elites unchanged, then P - elitism children.
        """
        config = self.config
        count = cost.shape[1] - config.elitism
        parents = selection.select(
            config.selection, cost, 2 * count, config.tournament, self.draws
        )
        first = _take(population, parents[:, :count])
        second = _take(population, parents[:, count:])
        second = self._headless_chicken(second)
        children = crossover.cross(
            config.crossover,
            first,
            second,
            self.draws,
            points=config.crossover_points,
            eta=config.sbx_eta,
            fixed_length=self.fixed_length,
        )
        children = self._mutate(children, rates)
        return self._with_elites(population, cost, children)

    def _headless_chicken(self, second: Population) -> Population:
        """Replace second parents by fresh random individuals, with a probability.

        The fresh ones come from a pool twice the expected number; were more wanted,
        one would serve twice.
        """
        chance = self.config.headless_chicken
        if chance <= 0:
            return second
        runs, count = second.lengths.shape
        pool = self.encoding.random(runs, max(1, int(2 * chance * count)), self.draws)
        chosen = self.draws.uniform(runs, count) < chance
        rank = (chosen.cumsum(1) - 1).clamp(min=0) % pool.lengths.shape[1]
        fresh = _take(pool, rank)
        return Population(
            torch.where(chosen[:, :, None, None], fresh.genes, second.genes),
            torch.where(chosen, fresh.lengths, second.lengths),
        )

    def _mutate(self, children: Population, rates: Rates) -> Population:
        genes = mutation.mutate(
            self.config.mutation,
            children.genes,
            self.draws.uniform(*children.genes.shape),
            rates.rate,
            rates.magnitude,
            self.encoding.low,
            self.encoding.high,
        )
        return children._replace(genes=genes * children.valid.unsqueeze(-1))

    def _with_elites(
        self, population: Population, cost: Tensor, children: Population
    ) -> Population:
        if self.config.elitism == 0:
            return children
        order = cost.topk(self.config.elitism, dim=1, largest=False).indices
        elites = _take(population, order)
        return Population(
            torch.cat([elites.genes, children.genes], dim=1),
            torch.cat([elites.lengths, children.lengths], dim=1),
        )


def _take(population: Population, index: Tensor) -> Population:
    """Individuals by index ``(R, N)``."""
    rows = torch.arange(index.shape[0], device=index.device)[:, None]
    return Population(population.genes[rows, index], population.lengths[rows, index])
