"""Populations that start anew: all but the best (B2), or the worst islands."""

from collections.abc import Sequence

import torch
from torch import Tensor


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
