"""Controllers: networks from two light readings to two wheel speeds (thesis 5.2.2).

A genome is a row of weights in the order: first layer ``(H, I)``, its biases ``(H,)``,
second layer ``(2, H)``, its biases ``(2,)``. Readings come as brightness, 0 in the dark
to 1 in full light; a recurrent controller is fed back its last two outputs. Both
layers are tanh (silent); an output of -1 is the lowest speed, 1 the highest.
"""

from dataclasses import dataclass
from typing import TypeVar

import numpy as np
import torch
from torch import Tensor

from bns.chromosome import Population
from bns.draws import Draws
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.units import metres_per_second

READINGS = 2
OUTPUTS = 2

Numbers = TypeVar("Numbers", np.ndarray, Tensor)


@dataclass(frozen=True)
class Controllers:
    """What all controllers of a batch have in common.

    Attributes:
        hidden: neurons H.
        recurrent: whether outputs are fed back.
        slowest, fastest: speeds of the outputs -1 and 1 [m/s].
        dead_band: speeds of a smaller magnitude mean stop [m/s].
        balanced: whether a reading is seen as -1 to 1 instead of 0 to 1.
    """

    hidden: int
    recurrent: bool
    slowest: float
    fastest: float
    dead_band: float
    balanced: bool = False

    @classmethod
    def of(cls, config: RunConfig) -> "Controllers":
        """Those a configuration asks for."""
        return cls(
            hidden=config.light.hidden,
            recurrent=config.light.recurrent,
            slowest=metres_per_second(config.controller.speed_low),
            fastest=metres_per_second(config.controller.speed_high),
            dead_band=metres_per_second(config.controller.dead_band),
            balanced=config.light.readings == "balanced",
        )

    @property
    def inputs(self) -> int:
        """Inputs of a controller: the readings, and what is fed back."""
        return READINGS + (OUTPUTS if self.recurrent else 0)

    @property
    def memory(self) -> int:
        """Numbers that a controller remembers from cycle to cycle."""
        return OUTPUTS if self.recurrent else 0

    @property
    def genes(self) -> int:
        """Weights of a controller."""
        return self.hidden * (self.inputs + 1) + OUTPUTS * (self.hidden + 1)

    def see(self, bright: Numbers) -> Numbers:
        """A brightness, 0 to 1, as the networks take it."""
        return 2 * bright - 1 if self.balanced else bright

    def layers(self, genomes: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """The weights of genomes, the individual as the last axis.

        Args:
            genomes: ``(R, P, genes)``.

        Returns:
            ``(R, I, H, P)``, ``(R, H, P)``, ``(R, 2, H, P)``, ``(R, 2, P)``.

        Raises:
            BnsError: genomes of another length.
        """
        runs, count, length = genomes.shape
        if length != self.genes:
            raise BnsError(
                f"A genome has {length} weights; a controller of {self.hidden} hidden "
                f"neurons and {self.inputs} inputs has {self.genes}."
            )
        sizes = [self.hidden * self.inputs, self.hidden, OUTPUTS * self.hidden, OUTPUTS]
        w1, b1, w2, b2 = genomes.transpose(1, 2).split(sizes, dim=1)
        return (
            w1.reshape(runs, self.hidden, self.inputs, count).transpose(1, 2).clone(),
            b1.contiguous(),
            w2.reshape(runs, OUTPUTS, self.hidden, count),
            b2.contiguous(),
        )

    def act(self, layers: tuple[Tensor, ...], inputs: list[Tensor]) -> list[Tensor]:
        """The outputs, -1 to 1.

        Args:
            layers: as `layers` gives them.
            inputs: brightness left and right, then what is fed back, each
                ``(R, S, P)``.

        Returns:
            Left and right, each ``(R, S, P)``.
        """
        w1, b1, w2, b2 = layers
        total = b1.unsqueeze(2)
        for weight, value in zip(w1.unbind(1), inputs, strict=True):
            total = total + weight.unsqueeze(2) * value.unsqueeze(1)
        active = _tanh(total)  # (R, H, S, P)
        return [
            _tanh((active * w2[:, side].unsqueeze(2)).sum(1) + b2[:, side, None])
            for side in range(OUTPUTS)
        ]

    def speed(self, output: Tensor) -> Tensor:
        """A wheel's speed [m/s] from an output."""
        middle = (self.fastest + self.slowest) / 2
        half = (self.fastest - self.slowest) / 2
        speed = middle + half * output
        return torch.where(speed.abs() < self.dead_band, 0.0, speed)


def _tanh(total: Tensor) -> Tensor:
    """tanh by a sigmoid, which compiled code computes several times as fast."""
    return 2 * (2 * total).sigmoid() - 1


@dataclass(frozen=True)
class Weights:
    """Genomes as the evolutionary operators take them: D places of one kind.

    Attributes:
        max_commands: weights of a genome, D.
        reach: random weights lie between - and + this, ``(R, 1, 1, 1)``.
        low, high: bounds of every weight, ``(1,)``.
    """

    max_commands: int
    reach: Tensor
    low: Tensor
    high: Tensor

    @classmethod
    def of(cls, controllers: Controllers, reach: Tensor, limit: float) -> "Weights":
        """Genomes of some controllers; `reach` is that of each row, ``(R,)``."""
        bound = torch.full((1,), limit, device=reach.device)
        return cls(controllers.genes, reach.view(-1, 1, 1, 1), -bound, bound)

    @property
    def gene_shape(self) -> tuple[int, int]:
        """Genes of an individual: places times kinds."""
        return self.max_commands, 1

    def random(self, rows: int, population: int, draws: Draws) -> Population:
        """Uniformly random weights."""
        coins = draws.uniform(rows, population, *self.gene_shape)
        return self.individuals(coins, coins[..., 0, 0])

    def individuals(self, coins: Tensor, coins_lengths: Tensor) -> Population:
        """Random individuals from uniform numbers ``(R, P, D, 1)``."""
        lengths = torch.full_like(coins_lengths, self.max_commands, dtype=torch.long)
        return Population((2 * coins - 1) * self.reach, lengths)
