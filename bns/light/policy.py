"""Genomes as the controllers of robots in a world."""

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np
import torch
from torch import Tensor

from bns.errors import BnsError
from bns.light.controller import Controllers
from bns.light.scaling import brightness


@dataclass(frozen=True, eq=False)
class Attempt:
    """One controller that is to drive one robot for one trial.

    Attributes:
        controllers: what it has in common with others.
        genome: its weights, ``(genes,)``.
        cycles, cycle: how many commands, and how long each lasts [s].
    """

    controllers: Controllers
    genome: Tensor
    cycles: int
    cycle: float


@dataclass(frozen=True, eq=False)
class GenomePolicy:
    """N genomes, one a robot; a `bns.worlds.closed_loop.Policy`.

    Attributes:
        controllers: what they have in common.
        genomes: ``(N, genes)``.

    Raises:
        BnsError: a weight that is NaN or infinite, genomes of the wrong length.
    """

    controllers: Controllers
    genomes: Tensor

    @classmethod
    def of(cls, attempts: Sequence[Attempt]) -> "GenomePolicy":
        """Attempts with controllers of one kind as one batch."""
        genomes = torch.stack([attempt.genome for attempt in attempts])
        return cls(attempts[0].controllers, genomes)

    def __post_init__(self):
        bad = ~torch.isfinite(self.genomes).all(1)
        if bad.any():
            raise BnsError(
                f"Genome {int(bad.nonzero()[0, 0])} holds NaN or infinity; give finite "
                "weights."
            )
        self._layers()

    def __len__(self) -> int:
        return len(self.genomes)

    def _layers(self) -> tuple[Tensor, ...]:
        return self.controllers.layers(self.genomes.unsqueeze(1))

    def memory(self, n: int) -> np.ndarray:
        """What n controllers remember at the start, shape ``(n, M)``."""
        return np.zeros((n, self.controllers.memory))

    def act(
        self, readings: np.ndarray, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wheel speeds ``(N, 2)`` [m/s] from readings ``(N, 2)`` [counts].

        Raises:
            BnsError: another number of robots or sensors.
        """
        if np.shape(readings) != (len(self), 2):
            raise BnsError(
                f"Readings of shape {np.shape(readings)} for {len(self)} controllers: "
                f"they need ({len(self)}, 2), the left and the right light sensor."
            )
        seen = np.concatenate(
            [self.controllers.see(brightness(readings)), memory], axis=1
        )
        inputs = torch.from_numpy(seen.astype(np.float32)).T[..., None, None]
        outputs = self.controllers.act(self._layers(), list(inputs))
        speeds = torch.cat([self.controllers.speed(o)[:, 0] for o in outputs], dim=1)
        told = torch.cat([output[:, 0] for output in outputs], dim=1)
        kept = told.double().numpy() if self.controllers.memory else memory
        return speeds.double().numpy(), kept
