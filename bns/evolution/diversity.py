"""How diverse a population is (thesis eqs 4.1, 5.1, 7.3).

Genes are taken as shares of their range, so that speeds and durations count alike.
The dissertation leaves variable lengths undefined; here the average individual has at
each place the mean over those individuals that have that place, and only genes that
exist are summed.
"""

import torch
from torch import Tensor

from bns.evolution.chromosome import Population
from bns.evolution.generation import Genes


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
