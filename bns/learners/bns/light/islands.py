"""Islands (B3): populations apart from each other, migrants, and those that start anew.

The islands of a run are rows of their own for all operators: R runs of I islands are
``R I`` rows, row ``r I + i`` being island i of run r.
"""

from collections.abc import Sequence

import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.evolution import selection
from bns.evolution.chromosome import Population
from bns.evolution.generation import take, whole_index
from bns.experiment.task_settings import LightConfig

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


def with_elitists(
    fresh: Tensor, old: Tensor, cost: Tensor, wanted: Sequence[int]
) -> Tensor:
    """A fresh population whose first individuals are the old one's best.

    Args:
        fresh, old: genes of the rows (islands), ``(R I, p, D, 1)``.
        cost: of the old ones, ``(R I, p)``.
        wanted: how many survive in each run, R numbers.
    """
    runs, most = len(wanted), max(wanted)
    if most == 0:
        return fresh
    shape = (runs, -1, *fresh.shape[2:])
    new, before = fresh.reshape(shape), old.reshape(shape)
    order = cost.reshape(runs, -1).topk(most, dim=1, largest=False).indices
    index = order[..., None, None].expand(-1, -1, *fresh.shape[2:])
    mine = torch.arange(most) < torch.tensor(wanted)[:, None]
    mine = mine.to(fresh.device)[..., None, None]
    first = torch.where(mine, before.gather(1, index), new[:, :most])
    return torch.cat([first, new[:, most:]], dim=1).reshape(fresh.shape)


def worst_islands(cost: Tensor, islands: int, count: int) -> Tensor:
    """Which islands have the worst best of their run, ``(R I,)`` bool.

    Args:
        cost: of the rows (islands), ``(R I, p)``.
        islands: I.
        count: how many in each run.
    """
    best = cost.amin(1).reshape(-1, islands)
    worst = best.topk(count, dim=1).indices
    return torch.zeros_like(best).scatter(1, worst, 1.0).flatten().bool()
