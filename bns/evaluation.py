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
    """What a population is worth according to the SNN.

    A command's effect depends on the one before it alone, so all commands of all
    individuals are predicted at once; only composing them is sequential. Inside, the
    individual is the last axis, so that every step works on contiguous memory.
    """

    encoding: Encoding
    scaling: Scaling
    shape: Shape
    task: NavigationTask

    def inputs(self, population: Population) -> Tensor:
        """Scaled network inputs, ``(R, 5, K * P)``, the individual varying fastest."""
        decoded = self.encoding.decode(population.genes)
        scaled = self.scaling.inputs(decoded)
        return scaled.permute(0, 3, 2, 1).flatten(2).contiguous()

    def path(
        self, theta: Tensor, inputs: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> tuple[Tensor, Tensor, Tensor]:
        """Predicted x, y [m] and yaw [rad] after each command, each ``(R, K, P)``.

        Beyond a list's end the robot stands.

        Args:
            theta: weights ``(R, D)``.
            inputs: as `inputs` gives them.
            lengths: commands of each individual ``(R, P)``.
            fused: use the form of the network meant for compilation.
        """
        runs, count = lengths.shape
        outputs = predict(self.shape, theta, inputs, fused=fused)
        moved = outputs.view(runs, 3, -1, count)
        places = torch.arange(moved.shape[2], device=lengths.device)[:, None]
        used = places < lengths.unsqueeze(1)
        steps = [
            torch.where(used, moved[:, axis] * self.scaling.output[axis], 0.0)
            for axis in range(3)
        ]
        return integrate(*steps, self.task.start, dim=1)

    def judge(
        self, theta: Tensor, inputs: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> Tensor:
        """Predicted cost ``(R, P)`` from inputs; arguments as in `path`."""
        x, y, _ = self.path(theta, inputs, lengths, fused=fused)
        return self.task.score(x.movedim(1, 0), y.movedim(1, 0), lengths)[0]

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost of a population, ``(R, P)``."""
        return self.judge(theta, self.inputs(population), population.lengths)

    def poses(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted pose at the start and after each command, ``(R, P, K + 1, 3)``."""
        path = self.path(theta, self.inputs(population), population.lengths)
        after = torch.stack(path, dim=-1).transpose(1, 2)
        start = torch.tensor(self.task.start, dtype=after.dtype, device=after.device)
        return torch.cat([start.expand_as(after[:, :, :1]), after], dim=2)

    def disagreement(self, theta: Tensor, population: Population) -> Tensor:
        """Variance of the ensemble's scaled predictions, summed over commands.

        Returns:
            ``(R, P)``; needs an ensemble (an SNN of kind "ensemble").
        """
        runs, count = population.lengths.shape
        outputs = forward(self.shape, theta, self.inputs(population))
        spread = outputs.var(1, unbiased=False).sum(1).view(runs, -1, count)
        return torch.where(population.valid.transpose(1, 2), spread, 0.0).sum(1)
