"""Islands: populations apart from each other, with migrants now and then (B3).

The islands of a run are rows of their own for all operators: R runs of I islands are
``R I`` rows, row ``r I + i`` being island i of run r.
"""

import torch
from torch import Tensor

from bns.chromosome import Population
from bns.draws import Draws, whole_below
from bns.evolution import selection
from bns.evolution.generation import take, whole_index
from bns.experiment.config import LightConfig

TOURNAMENT = 3  # of migrants chosen by tournament; silent


def migrate(
    population: Population, cost: Tensor, config: LightConfig, draws: Draws
) -> Population:
    """Copies of migrants take the place of others on another island.

    Args:
        population: of the rows, ``(R I, p, ...)``.
        cost: ``(R I, p)``.
        config: islands, migrants, topology, selection and replacement.
        draws: source of randomness.
    """
    rows, size = cost.shape
    count = min(config.migrants, size)
    if config.islands == 1 or count == 0:
        return population
    going = take(population, _migrants(cost, count, config, draws))
    source = _sources(rows, config, draws)
    genes = going.genes[source]
    place = _places(cost, count, config, draws)
    return Population(
        population.genes.scatter(1, whole_index(place, genes.shape), genes),
        population.lengths.scatter(1, place, going.lengths[source]),
    )


def _migrants(cost: Tensor, count: int, config: LightConfig, draws: Draws) -> Tensor:
    if config.migrant == "best":
        return cost.topk(count, dim=1, largest=False).indices
    size = TOURNAMENT if config.migrant == "tournament" else 1
    coins = draws.uniform(len(cost), count, min(size, cost.shape[1]))
    return selection.tournament(cost, coins)


def _sources(rows: int, config: LightConfig, draws: Draws) -> Tensor:
    """The row that each row's immigrants come from, ``(R I,)``."""
    islands = config.islands
    row = torch.arange(rows, device=draws.device)
    run, island = row // islands, row % islands
    if config.topology == "ring":
        shift = torch.ones_like(run)
    else:
        coins = draws.uniform(rows // islands)
        shift = (1 + whole_below(coins, islands - 1))[run]
    return run * islands + (island - shift) % islands


def _places(cost: Tensor, count: int, config: LightConfig, draws: Draws) -> Tensor:
    """Whose place the immigrants take, ``(R I, count)``; never the best's at random."""
    if config.replaced == "worst":
        return cost.topk(count, dim=1).indices
    coins = draws.uniform(*cost.shape)
    best = cost.argmin(1, keepdim=True)
    return coins.scatter(1, best, -1.0).topk(count, dim=1).indices
