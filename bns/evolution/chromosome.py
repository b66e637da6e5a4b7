"""Variable-length chromosomes: lists of (left speed, right speed, duration) genes.

A population is two tensors: `genes` of shape ``(R, P, K, 3)`` [m/s, m/s, s], padded
with zeros beyond each list, and `lengths` of shape ``(R, P)``. R is the run axis.
"""

from dataclasses import dataclass
from typing import NamedTuple

import numpy as np
import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.experiment.task_settings import ControllerConfig, metres_per_second
from bns.worlds.trial import Commands


class Population(NamedTuple):
    """Controllers of R runs: genes ``(R, P, K, 3)``, lengths ``(R, P)`` int64."""

    genes: Tensor
    lengths: Tensor

    def pick(self, index: Tensor) -> "Population":
        """One individual a run, `index` of shape ``(R,)``; keeps P = 1."""
        rows = torch.arange(len(index), device=index.device)
        return Population(
            self.genes[rows, index].unsqueeze(1), self.lengths[rows, index].unsqueeze(1)
        )

    @property
    def valid(self) -> Tensor:
        """Which places hold a command, ``(R, P, K)`` bool."""
        places = torch.arange(self.genes.shape[2], device=self.genes.device)
        return places < self.lengths.unsqueeze(-1)


@dataclass(frozen=True)
class Encoding:
    """What genes may be, and what they mean.

    Attributes:
        low, high: gene bounds, each ``(3,)`` [m/s, m/s, s].
        dead_band: speeds of a smaller magnitude mean stop [m/s].
        max_commands: K.
        initial: shortest and longest list of a random individual.
    """

    low: Tensor
    high: Tensor
    dead_band: float
    max_commands: int
    initial: tuple[int, int]

    @property
    def gene_shape(self) -> tuple[int, int]:
        """Genes of an individual: places times kinds."""
        return self.max_commands, 3

    @classmethod
    def of(cls, config: ControllerConfig, device: str = "cpu") -> "Encoding":
        """The encoding that a configuration asks for."""
        low = metres_per_second(config.speed_low)
        high = metres_per_second(config.speed_high)
        longest = config.max_commands
        initial = (config.initial_min, min(config.initial_max, longest))
        return cls(
            low=torch.tensor([low, low, config.duration_low], device=device),
            high=torch.tensor([high, high, config.duration_high], device=device),
            dead_band=metres_per_second(config.dead_band),
            max_commands=longest,
            initial=(longest, longest) if config.fixed_length else initial,
        )

    def random(self, runs: int, population: int, draws: Draws) -> Population:
        """Uniformly random genes, uniformly random lengths.

        Args:
            runs: R.
            population: P, individuals of each run.
            draws: source of randomness.
        """
        lengths = draws.uniform(runs, population)
        genes = draws.uniform(runs, population, self.max_commands, 3)
        return self.individuals(genes, lengths)

    def individuals(self, coins: Tensor, coins_lengths: Tensor) -> Population:
        """Random individuals from uniform numbers ``(R, P, K, 3)`` and ``(R, P)``."""
        shortest, longest = self.initial
        lengths = shortest + whole_below(coins_lengths, longest + 1 - shortest)
        genes = self.low + coins * (self.high - self.low)
        drawn = Population(genes, lengths)
        return drawn._replace(genes=genes * drawn.valid.unsqueeze(-1))

    def decode(self, genes: Tensor) -> Tensor:
        """Genes as commands: speeds inside the dead band become 0, same shape."""
        speeds = genes[..., :2]
        speeds = torch.where(speeds.abs() < self.dead_band, 0.0, speeds)
        return torch.cat([speeds, genes[..., 2:]], dim=-1)

    def commands(self, individual: Population) -> list[Commands]:
        """The first individual of each run as commands for a world."""
        decoded = self.decode(individual.genes[:, 0]).cpu().numpy().astype(np.float64)
        lengths = individual.lengths[:, 0].tolist()
        return [
            Commands(row[:n, :2], row[:n, 2])
            for row, n in zip(decoded, lengths, strict=True)
        ]
