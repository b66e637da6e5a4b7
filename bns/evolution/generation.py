"""One generation: elites, parents, crossover, mutation (thesis Algorithm 1).

A generation is a pure function of the population, its costs and uniform numbers drawn
beforehand (`Coins`), so that it can be compiled as a whole and tested number by number.

Diversity (thesis eqs 4.1, 5.1, 7.3): genes are taken as shares of their range, so that
speeds and durations count alike. The dissertation leaves variable lengths undefined;
here the average individual has at each place the mean over those individuals that have
that place, and only genes that exist are summed.
"""

from dataclasses import dataclass
from typing import NamedTuple, Protocol

import torch
from torch import Tensor

from bns.draws import Draws
from bns.evolution import selection, variation
from bns.evolution.chromosome import Population
from bns.learners.bns.config import EvolutionConfig


class Genes(Protocol):
    """What genes may be: P individuals of K places, each of so many kinds."""

    @property
    def low(self) -> Tensor:
        """Lowest gene of each kind."""

    @property
    def high(self) -> Tensor:
        """Highest gene of each kind."""

    @property
    def gene_shape(self) -> tuple[int, int]:
        """Genes of an individual: places times kinds."""

    def random(self, runs: int, population: int, draws: Draws) -> Population:
        """Random individuals.

        Args:
            runs: R.
            population: P, individuals of each run.
            draws: source of randomness.
        """

    def individuals(self, coins: Tensor, coins_lengths: Tensor) -> Population:
        """Random individuals from uniform numbers."""


class Rates(NamedTuple):
    """Mutation settings, one per run.

    Attributes:
        rate: probability per gene, ``(R,)``.
        magnitude: of each gene kind, ``(R, 3)`` [m/s, m/s, s] (weights: ``(R, 1)``).
        chicken: probability of a fresh second parent, ``(R,)``; None = that of the
            configuration.
        repeat: probability that a walker's child repeats its commands, ``(R,)``, see
            `bns.evolution.goals`; None = none does.
        reach: farthest that a walker's goals are from half-way, ``(C,)`` [rad]; None =
            as the encoding has it.
    """

    rate: Tensor
    magnitude: Tensor
    chicken: Tensor | None = None
    repeat: Tensor | None = None
    reach: Tensor | None = None


class Coins(NamedTuple):
    """Uniform numbers of one generation, N children a run.

    Attributes:
        parents: ``(R, 2 N, tournament)``.
        chicken: which second parents are fresh ones, ``(R, N)``.
        fresh: genes of the fresh ones, ``(R, F, K, 3)``; F = 0 without them.
        fresh_lengths: ``(R, F)``.
        crossover: as the operator needs.
        mutation: ``(R, N, K, 3)``.
        repeat: what repetition needs; None = there is none.
    """

    parents: Tensor
    chicken: Tensor
    fresh: Tensor
    fresh_lengths: Tensor
    crossover: Tensor
    mutation: Tensor
    repeat: Tensor | None = None


@dataclass(frozen=True)
class Breeder:
    """Makes the next population from the present one and its costs."""

    config: EvolutionConfig
    encoding: Genes
    fixed_length: bool

    def draw(self, draws: Draws, rates: Rates) -> Coins:
        """The random numbers of one generation of as many runs as `rates` has.

        Fresh individuals (headless chicken) are a pool twice the expected number;
        were more wanted, one would serve twice.
        """
        config = self.config
        count = config.population - config.elitism
        runs = len(rates.rate)
        genes = (runs, count, *self.encoding.gene_shape)
        pool = 0
        if config.headless_chicken > 0:
            pool = max(1, int(2 * config.headless_chicken * count))
        needed = variation.coins_needed(
            config.crossover, config.crossover_points, genes
        )
        return Coins(
            parents=draws.uniform(runs, 2 * count, config.tournament),
            chicken=draws.uniform(runs, count),
            fresh=draws.uniform(runs, pool, *genes[2:]),
            fresh_lengths=draws.uniform(runs, pool),
            crossover=draws.uniform(*needed),
            mutation=draws.uniform(*genes),
        )

    def breed(
        self, population: Population, cost: Tensor, rates: Rates, coins: Coins
    ) -> Population:
        """The next generation.

        Args:
            population: P individuals of R runs.
            cost: ``(R, P)``, lower is better.
            rates: mutation settings.
            coins: this generation's random numbers.

        Returns:
            The elites unchanged, then P - elitism children.
        """
        config = self.config
        parents = self.parents(cost, coins.parents)
        mothers, fathers = parents.chunk(2, dim=1)
        first, second = take(population, mothers), take(population, fathers)
        children = variation.cross(
            config.crossover,
            first,
            self._headless_chicken(second, coins, rates.chicken),
            coins.crossover,
            eta=config.sbx_eta,
            fixed_length=self.fixed_length,
        )
        if config.crossover == "sbx":  # its children lie beyond their parents as well
            children = self._bounded(children)
        children = self._mutate(children, rates, coins)
        return self._with_elites(population, cost, children)

    def parents(self, cost: Tensor, coins: Tensor) -> Tensor:
        """Indices of the parents, ``(R, 2 N)``; `coins` as in `Coins`."""
        return selection.select(self.config.selection, cost, coins)

    def _headless_chicken(
        self, second: Population, coins: Coins, chance: Tensor | None
    ) -> Population:
        """Replace second parents by fresh random individuals, with a probability."""
        if coins.fresh.shape[1] == 0:
            return second
        pool = self.encoding.individuals(coins.fresh, coins.fresh_lengths)
        wanted = self.config.headless_chicken if chance is None else chance[:, None]
        chosen = coins.chicken < wanted
        rank = (chosen.long().cumsum(1) - 1).clamp(min=0) % pool.lengths.shape[1]
        fresh = take(pool, rank)
        return Population(
            torch.where(chosen[:, :, None, None], fresh.genes, second.genes),
            torch.where(chosen, fresh.lengths, second.lengths),
        )

    def _bounded(self, children: Population) -> Population:
        low, high = self.encoding.low, self.encoding.high
        genes = torch.minimum(torch.maximum(children.genes, low), high)
        return children._replace(genes=genes)

    def _mutate(self, children: Population, rates: Rates, coins: Coins) -> Population:
        genes = variation.mutate(
            self.config.mutation,
            children.genes,
            coins.mutation,
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
        elites = take(population, order)
        return Population(
            torch.cat([elites.genes, children.genes], dim=1),
            torch.cat([elites.lengths, children.lengths], dim=1),
        )


def take(population: Population, index: Tensor) -> Population:
    """Individuals by index ``(R, N)``."""
    places = whole_index(index, population.genes.shape)
    return Population(
        population.genes.gather(1, places), population.lengths.gather(1, index)
    )


def whole_index(index: Tensor, shape: torch.Size) -> Tensor:
    """An index ``(R, N)`` expanded to gather genes of `shape` (R, P, K, 3)."""
    return index[:, :, None, None].expand(-1, -1, shape[2], shape[3])


def deviations(population: Population, encoding: Genes) -> Tensor:
    """|c_ij - mean_j| for genes that exist, 0 elsewhere, ``(R, P, K, 3)``."""
    valid = population.valid.unsqueeze(-1)
    scaled = (population.genes - encoding.low) / (encoding.high - encoding.low)
    scaled = torch.where(valid, scaled, 0.0)
    mean = scaled.sum(1, keepdim=True) / valid.sum(1, keepdim=True).clamp(min=1)
    return torch.where(valid, (scaled - mean).abs(), 0.0)


def measures(population: Population, encoding: Genes) -> dict[str, Tensor]:
    """All three measures, each ``(R,)``: sum, sum of squares, log of the sum."""
    apart = deviations(population, encoding)
    total = apart.sum((1, 2, 3))
    return {
        "diversity_41": total,
        "diversity_51": apart.square().sum((1, 2, 3)),
        "diversity_73": total.clamp(min=1e-12).log(),
    }
