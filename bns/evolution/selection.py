"""Selection of individuals by cost (thesis 2.3.6), batched over runs.

Each operator takes ``cost`` of shape ``(R, P)`` and returns indices ``(R, N)``.
"""

import torch
from torch import Tensor

from bns.draws import Draws
from bns.errors import UnknownNameError


def tournament(cost: Tensor, count: int, size: int, draws: Draws) -> Tensor:
    """The best of `size` individuals drawn at random (with replacement)."""
    runs, population = cost.shape
    entrants = draws.below(population, runs, count, size)
    rows = torch.arange(runs, device=cost.device)[:, None, None]
    winner = cost[rows, entrants].argmin(-1, keepdim=True)
    return entrants.gather(-1, winner).squeeze(-1)


def best(cost: Tensor, count: int) -> Tensor:
    """The best individual, `count` times."""
    return cost.argmin(1, keepdim=True).expand(-1, count)


def random(cost: Tensor, count: int, draws: Draws) -> Tensor:
    """Any individual, with equal chance."""
    return draws.below(cost.shape[1], cost.shape[0], count)


def roulette(cost: Tensor, count: int, draws: Draws) -> Tensor:
    """Chance proportional to fitness (eq 2.14).

    Costs are turned into fitness as worst cost minus cost, so the worst individual
    is never drawn; where all are equal, every one has the same chance.
    """
    fitness = cost.max(1, keepdim=True).values - cost
    total = fitness.sum(1, keepdim=True)
    share = torch.where(total > 0, fitness / total, 1.0 / cost.shape[1])
    edges = share.double().cumsum(1)
    spins = draws.uniform(cost.shape[0], count).double() * edges[:, -1:]
    found = torch.searchsorted(edges, spins, right=True)
    return found.clamp(max=cost.shape[1] - 1)


def select(kind: str, cost: Tensor, count: int, size: int, draws: Draws) -> Tensor:
    """Selection by name; `size` is the tournament's.

    Raises:
        UnknownNameError: no such operator.
    """
    if kind == "tournament":
        return tournament(cost, count, size, draws)
    if kind == "best":
        return best(cost, count)
    if kind == "random":
        return random(cost, count, draws)
    if kind == "roulette":
        return roulette(cost, count, draws)
    known = ("tournament", "best", "random", "roulette")
    raise UnknownNameError("selection", kind, known)
