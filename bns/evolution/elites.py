"""Survivors of a grid: the best of each cell of behaviours (Mouret and Clune 2015).

MAP-Elites with as many places as the population has: of parents and children together
the best of each cell lives on, the cheapest cells first where there are too many, and
places that are left go to the best of the rest.
"""

import torch
from torch import Tensor


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
