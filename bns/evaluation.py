"""Evaluating controllers inside the SNN: commands -> predicted path -> cost."""

from dataclasses import dataclass

import torch
from torch import Tensor

from bns.chromosome import Encoding, Population
from bns.path import integrate
from bns.snn.network import Shape, forward, predict
from bns.snn.scaling import Scaling
from bns.tasks import NavigationTask


@dataclass(frozen=True)
class Evaluator:
    """What a population is worth according to the SNN."""

    encoding: Encoding
    scaling: Scaling
    shape: Shape
    task: NavigationTask

    def displacements(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted displacement of each command, ``(R, P, K, 3)`` [m, m, rad].

        A command depends on the one before it alone, so all are predicted at once.
        Places beyond a list give no motion.
        """
        runs, count, longest, _ = population.genes.shape
        scaled = self._inputs(population)
        outputs = predict(self.shape, theta, scaled)
        outputs = outputs.view(runs, 3, count, longest).permute(0, 2, 3, 1)
        moved = outputs * self.scaling.output
        return torch.where(population.valid.unsqueeze(-1), moved, 0.0)

    def _inputs(self, population: Population) -> Tensor:
        decoded = self.encoding.decode(population.genes)
        scaled = self.scaling.inputs(decoded)
        return scaled.flatten(1, 2).transpose(1, 2).contiguous()

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost, ``(R, P)``."""
        moved = self.displacements(theta, population)
        positions, _ = integrate(moved, self.task.start)
        return self.task.score(positions, population.lengths)[0]

    def poses(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted pose at the start and after each command, ``(R, P, K + 1, 3)``."""
        moved = self.displacements(theta, population)
        positions, headings = integrate(moved, self.task.start)
        after = torch.cat([positions, headings.unsqueeze(-1)], dim=-1)
        start = torch.tensor(self.task.start, dtype=after.dtype, device=after.device)
        return torch.cat([start.expand_as(after[:, :, :1]), after], dim=2)

    def disagreement(self, theta: Tensor, population: Population) -> Tensor:
        """Variance of the ensemble's scaled predictions, summed over commands.

        Returns:
            ``(R, P)``; needs an ensemble (an SNN of kind "ensemble").
        """
        runs, count, longest, _ = population.genes.shape
        outputs = forward(self.shape, theta, self._inputs(population))
        spread = outputs.var(1, unbiased=False).sum(1).view(runs, count, longest)
        return torch.where(population.valid, spread, 0.0).sum(-1)
