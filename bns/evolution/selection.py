"""Selection of individuals by cost (thesis 2.3.6), and survivors of a grid, batched.

Each operator takes ``cost`` of shape ``(R, P)`` and uniform numbers `coins`, one row of
them per individual to select, and returns indices ``(R, N)``.

Survivors of a grid are the best of each cell of behaviours (Mouret and Clune 2015),
MAP-Elites with as many places as the population has: of parents and children together
the best of each cell lives on, the cheapest cells first where there are too many, and
places that are left go to the best of the rest.
"""

import torch
from torch import Tensor

from bns.draws import whole_below
from bns.errors import UnknownNameError

KINDS = ("best", "random", "roulette", "tournament")


def tournament(cost: Tensor, coins: Tensor) -> Tensor:
    """The best of `size` individuals drawn at random (with replacement).

    Args:
        cost: ``(R, P)``.
        coins: ``(R, N, size)``.
    """
    entrants = whole_below(coins, cost.shape[1])
    rows = torch.arange(cost.shape[0], device=cost.device)[:, None, None]
    winner = cost[rows, entrants].argmin(-1, keepdim=True)
    return entrants.gather(-1, winner).squeeze(-1)


def tournament_by_rank(cost: Tensor, coins: Tensor, size: int) -> Tensor:
    """As `tournament`, its winners drawn by their ranks: one number for each.

    That all of `size` entrants rank behind place k has the chance ((P - k) / P)^size.

    Args:
        cost: ``(R, P)``.
        coins: ``(R, N)``.
        size: of the tournaments.
    """
    count = cost.shape[1]
    rank = ((1 - coins ** (1 / size)) * count).long().clamp(max=count - 1)
    return cost.argsort(dim=1, stable=True).gather(1, rank)


def best(cost: Tensor, coins: Tensor) -> Tensor:
    """The best individual every time; `coins` ``(R, N, ...)`` only says how often."""
    return cost.argmin(1, keepdim=True).expand(-1, coins.shape[1])


def random(cost: Tensor, coins: Tensor) -> Tensor:
    """Any individual, with equal chance; `coins` ``(R, N, ...)``."""
    return whole_below(coins[..., 0], cost.shape[1])


def roulette(cost: Tensor, coins: Tensor) -> Tensor:
    """Chance proportional to fitness (eq 2.14); `coins` ``(R, N, ...)``.

    Costs are turned into fitness as worst cost minus cost, so the worst individual
    is never drawn; where all are equal, every one has the same chance.
    """
    fitness = cost.max(1, keepdim=True).values - cost
    total = fitness.sum(1, keepdim=True)
    share = torch.where(total > 0, fitness / total, 1.0 / cost.shape[1])
    edges = share.double().cumsum(1)
    spins = coins[..., 0].double() * edges[:, -1:]
    found = torch.searchsorted(edges, spins.contiguous(), right=True)
    return found.clamp(max=cost.shape[1] - 1)


def select(kind: str, cost: Tensor, coins: Tensor) -> Tensor:
    """Selection by name; the last axis of `coins` is the tournament's size.

    Raises:
        UnknownNameError: no such operator.
    """
    if kind not in KINDS:
        raise UnknownNameError("selection", kind, KINDS)
    operators = {
        "best": best,
        "random": random,
        "roulette": roulette,
        "tournament": tournament,
    }
    return operators[kind](cost, coins)


def cells(behaviours: Tensor, bins: int) -> Tensor:
    """Number of the cell of each behaviour.

    Args:
        behaviours: each from 0 to 1, ``(R, P, B)``.
        bins: along each of them.

    Returns:
        ``(R, P)``.
    """
    steps = (behaviours * bins).long().clamp(0, bins - 1)
    weights = bins ** torch.arange(steps.shape[2], device=steps.device)
    return (steps * weights).sum(2)


def survivors(cells: Tensor, cost: Tensor, count: int) -> Tensor:
    """Who lives on, the elites of cells first, each group by cost.

    Args:
        cells: ``(R, N)``.
        cost: ``(R, N)``, lower is better.
        count: how many do.

    Returns:
        Indices ``(R, count)``.
    """
    by_cost = cost.argsort(dim=1, stable=True)
    held, by_cell = cells.gather(1, by_cost).sort(dim=1, stable=True)
    first = torch.ones_like(held, dtype=torch.bool)
    first[:, 1:] = held[:, 1:] != held[:, :-1]
    elite = torch.zeros_like(first).scatter(1, by_cell, first)
    later = torch.where(elite, 0, cells.shape[1])
    place = torch.arange(cells.shape[1], device=cells.device) + later
    return by_cost.gather(1, place.argsort(dim=1))[:, :count]
