"""Mutation of genes (thesis 2.3.8), batched over runs.

Every operator changes each gene with probability `rate` and keeps it inside the
encoding's bounds. One uniform number a gene decides both: below `rate` the gene
mutates, and the number divided by `rate` is uniform again.
"""

import torch
from torch import Tensor

from bns.errors import UnknownNameError


def bounded_uniform(share: Tensor, genes: Tensor, magnitude: Tensor) -> Tensor:
    """Eq 2.19: add a number uniform in -magnitude..magnitude.

    Args:
        share: uniform numbers, as `genes`.
        genes: ``(R, P, K, 3)``.
        magnitude: per run and gene kind, broadcasting to `genes`.
    """
    return genes + (2 * share - 1) * magnitude


def uniform_range(share: Tensor, genes: Tensor, low: Tensor, high: Tensor) -> Tensor:
    """Eq 2.18: with equal chance go uniformly towards the upper or lower bound.

    Args:
        share: uniform numbers, as `genes`.
        genes: ``(R, P, K, 3)``.
        low, high: gene bounds, ``(3,)``.
    """
    up = share < 0.5
    part = torch.where(up, 2 * share, 2 * share - 1)
    return torch.where(up, genes + part * (high - genes), genes - part * (genes - low))


def gaussian(share: Tensor, genes: Tensor, magnitude: Tensor) -> Tensor:
    """Eq 2.20: add a normal number of standard deviation `magnitude`."""
    return genes + normal(share) * magnitude


def normal(share: Tensor) -> Tensor:
    """Standard normal numbers from uniform ones."""
    inside = share.clamp(1e-6, 1 - 1e-6)
    return torch.erfinv(2 * inside - 1) * 2**0.5


def mutate(
    kind: str,
    genes: Tensor,
    coins: Tensor,
    rate: Tensor,
    magnitude: Tensor,
    low: Tensor,
    high: Tensor,
) -> Tensor:
    """Mutation by name.

    Args:
        kind: operator.
        genes: ``(R, P, K, 3)``.
        coins: uniform numbers, as `genes`.
        rate: mutation probability, ``(R,)``.
        magnitude: per run and gene kind, ``(R, 3)``, units of the genes.
        low, high: gene bounds, ``(3,)``.

    Raises:
        UnknownNameError: no such operator.
    """
    chance = rate[:, None, None, None]
    size = magnitude[:, None, None, :]
    share = (coins / chance).clamp(max=1.0)
    if kind == "bounded-uniform":
        changed = bounded_uniform(share, genes, size)
    elif kind == "uniform-range":
        changed = uniform_range(share, genes, low, high)
    elif kind == "gaussian":
        changed = gaussian(share, genes, size)
    else:
        known = ("bounded-uniform", "uniform-range", "gaussian")
        raise UnknownNameError("mutation", kind, known)
    changed = torch.minimum(torch.maximum(changed, low), high)
    return torch.where(coins < chance, changed, genes)
