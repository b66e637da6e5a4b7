"""Evaluating walks inside the SNN: servo goals -> predicted path -> cost."""

from dataclasses import dataclass

import torch
from torch import Tensor

from bns.chromosome import Population
from bns.experiment.config import WalkConfig
from bns.path import integrate
from bns.snn.network import Shape, forward
from bns.walk import fitness
from bns.walk.scaling import MOVED, inputs

START = (0.0, 0.0, 0.0)
CHUNK = 1100  # patterns predicted at once on a CPU: activations stay in its cache


@dataclass(frozen=True)
class WalkEvaluator:
    """What a population is worth according to an ensemble; as `Evaluator`.

    Attributes:
        shape: of the ensemble.
        config: which fitness.
    """

    shape: Shape
    config: WalkConfig

    def inputs(self, population: Population) -> Tensor:
        """Network inputs, ``(R, 2 C, K * P)``, the individual varying fastest."""
        scaled = inputs(population.genes)
        return scaled.permute(0, 3, 2, 1).flatten(2).contiguous()

    def members(self, theta: Tensor, seen: Tensor) -> Tensor:
        """Scaled outputs of every member, ``(R, G, 3, N)``, piece by piece."""
        if seen.device.type != "cpu":
            return forward(self.shape, theta, seen)
        return torch.cat(
            [
                torch.cat([forward(self.shape, row, part) for part in parts], dim=3)
                for row, parts in zip(
                    theta.split(1), map(_pieces, seen.split(1)), strict=True
                )
            ]
        )

    def judge(
        self, theta: Tensor, seen: Tensor, lengths: Tensor, *, fused: bool = False
    ) -> Tensor:
        """Predicted cost ``(R, P)`` from inputs; `fused` changes nothing here."""
        del fused
        return self.worth(self.members(theta, seen), lengths.shape[1])

    def worth(self, outputs: Tensor, count: int) -> Tensor:
        """Cost ``(R, P)`` of P = `count` individuals from the members' outputs."""
        if self.config.fitness == "repaired":
            x, y, _ = path(outputs, count)
            return fitness.repaired(x[:, :, -1], y[:, :, -1], self.config.doubt)
        x, y, _ = path(outputs.mean(1, keepdim=True), count)
        distance = (x[:, 0, -1].square() + y[:, 0, -1].square()).sqrt()
        return fitness.printed(distance, variance(outputs, count))

    def cost(self, theta: Tensor, population: Population) -> Tensor:
        """Predicted cost of a population, ``(R, P)``."""
        return self.judge(theta, self.inputs(population), population.lengths)

    def poses(self, theta: Tensor, population: Population) -> Tensor:
        """Pose at the start and after each command as the members' mean foresees it.

        Returns:
            ``(R, P, K + 1, 3)`` [m, m, rad].
        """
        outputs = self.members(theta, self.inputs(population))
        x, y, yaw = path(outputs.mean(1, keepdim=True), population.lengths.shape[1])
        after = torch.stack([x[:, 0], y[:, 0], yaw[:, 0]], dim=-1).transpose(1, 2)
        return torch.nn.functional.pad(after, (0, 0, 1, 0))

    def disagreement(self, theta: Tensor, population: Population) -> Tensor:
        """V of equation 7.2 for a population, ``(R, P)``."""
        outputs = self.members(theta, self.inputs(population))
        return variance(outputs, population.lengths.shape[1])


def path(outputs: Tensor, count: int) -> tuple[Tensor, Tensor, Tensor]:
    """Compose each member's own path.

    Args:
        outputs: scaled, ``(R, G, 3, K * P)``.
        count: P.

    Returns:
        x, y [m] and yaw [rad] after each command, each ``(R, G, K, P)``.
    """
    runs, members = outputs.shape[:2]
    moved = outputs.view(runs, members, 3, -1, count)
    steps = [moved[:, :, axis] * MOVED[axis] for axis in range(3)]
    return integrate(*steps, START, dim=2)


def variance(outputs: Tensor, count: int) -> Tensor:
    """Equation 7.2: the members' variance of the scaled outputs, summed over these
    and over commands, ``(R, P)``; members along axis 1."""
    spread = outputs.var(1, unbiased=False).sum(1)
    return spread.view(len(outputs), -1, count).sum(1)


def _pieces(seen: Tensor) -> tuple[Tensor, ...]:
    return tuple(part.contiguous() for part in seen.split(CHUNK, dim=2))
