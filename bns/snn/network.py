"""Stacked one-hidden-layer networks: R runs of G networks as one tensor program.

All weights of a run are one row of `theta`, shape ``(R, D)``, so that Rprop is
elementwise over one tensor. Two shapes are used: G = 3 networks with one output each
(thesis Fig 4.4: forward, left, turn), or an ensemble of G networks with all three
outputs and dropout (thesis 7.2.4).

Inputs and outputs of the motion SNN are scaled to about -1..1. Inputs (thesis Fig 4.4):
previous left and right wheel speed, new left and right wheel speed [m/s], duration [s];
the previous speeds are 0 at the start. Outputs: forward, left [m] and turn [rad] in the
body frame at the command's start.

From displacements in the body frame to a path in the world frame, batched.
"""

from dataclasses import dataclass
from typing import Literal

import torch
from torch import Tensor

from bns.draws import Draws
from bns.evolution.chromosome import Encoding
from bns.learners.bns.config import SnnConfig

INPUTS = 5
OUTPUTS = 3
AXLE = 0.0884  # [m] Khepera III axle, only to scale the turn (not fitted)


@dataclass(frozen=True)
class Scaling:
    """Offsets and scales, from the encoding's bounds.

    Attributes:
        centre, half: of the inputs, ``(5,)`` [m/s x4, s].
        output: scale of the outputs, ``(3,)`` [m, m, rad].
    """

    centre: Tensor
    half: Tensor
    output: Tensor

    @classmethod
    def of(cls, encoding: Encoding) -> "Scaling":
        """Scaling for commands inside an encoding's bounds."""
        top = encoding.high[0].item()
        shortest, longest = encoding.low[2].item(), encoding.high[2].item()
        middle, width = (shortest + longest) / 2, (longest - shortest) / 2
        device = encoding.low.device
        return cls(
            centre=torch.tensor([0.0, 0.0, 0.0, 0.0, middle], device=device),
            half=torch.tensor([top, top, top, top, width], device=device),
            output=torch.tensor(
                [top * longest, top * longest, top * longest / AXLE], device=device
            ),
        )

    def inputs(self, decoded: Tensor) -> Tensor:
        """Network inputs of command lists.

        Args:
            decoded: commands after the dead band, ``(..., K, 3)``.

        Returns:
            ``(..., K, 5)``, scaled.
        """
        speeds = decoded[..., :2]
        before = torch.nn.functional.pad(speeds, (0, 0, 1, 0))[..., :-1, :]
        return (torch.cat([before, decoded], dim=-1) - self.centre) / self.half


Activation = Literal["sigmoid", "relu"]


@dataclass(frozen=True)
class Shape:
    """Sizes of a stack: `groups` networks of `hidden` neurons, `outputs` each.

    `activation` is that of the hidden neurons.
    """

    groups: int
    hidden: int
    outputs: int
    inputs: int = INPUTS
    activation: Activation = "sigmoid"

    @classmethod
    def of(cls, config: SnnConfig) -> "Shape":
        """The stack a configuration asks for."""
        if config.kind == "three":
            return cls(groups=OUTPUTS, hidden=config.hidden, outputs=1)
        return cls(groups=config.members, hidden=config.hidden, outputs=OUTPUTS)

    @property
    def units(self) -> int:
        """Hidden neurons of all networks together."""
        return self.groups * self.hidden

    @property
    def size(self) -> int:
        """Weights of a run, D."""
        first = self.units * (self.inputs + 1)
        return first + self.groups * self.outputs * (self.hidden + 1)

    def split(self, theta: Tensor) -> tuple[Tensor, Tensor, Tensor, Tensor]:
        """Views of `theta` (R, D).

        Returns:
            first weights ``(R, G*H, I)``, first biases ``(R, G*H, 1)``, second
            weights ``(R, G, O, H)``, second biases ``(R, G, O, 1)``.
        """
        runs = theta.shape[0]
        heads = self.groups * self.outputs
        sizes = [self.units * self.inputs, self.units, heads * self.hidden, heads]
        w1, b1, w2, b2 = theta.split(sizes, dim=1)
        return (
            w1.view(runs, self.units, self.inputs),
            b1.view(runs, self.units, 1),
            w2.view(runs, self.groups, self.outputs, self.hidden),
            b2.view(runs, self.groups, self.outputs, 1),
        )

    def random(self, runs: int, draws: Draws) -> Tensor:
        """Fresh weights, uniform in +-1/sqrt(fan in), ``(R, D)``."""
        uniform = 2 * draws.uniform(runs, self.size) - 1
        first = self.units * (self.inputs + 1)
        scale = torch.full_like(uniform[0], self.hidden**-0.5)
        scale[:first] = self.inputs**-0.5
        return uniform * scale


def hidden_layer(shape: Shape, theta: Tensor, inputs: Tensor) -> Tensor:
    """Activations of the hidden neurons.

    Args:
        shape: sizes.
        theta: weights ``(R, D)``.
        inputs: ``(R, I, N)``.

    Returns:
        ``(R, G, H, N)``.
    """
    w1, b1, _, _ = shape.split(theta)
    total = torch.baddbmm(b1, w1, inputs)
    active = total.sigmoid_() if shape.activation == "sigmoid" else total.relu_()
    return active.view(theta.shape[0], shape.groups, shape.hidden, -1)


def slope(shape: Shape, active: Tensor) -> Tensor:
    """Derivative of the activation, from what `hidden_layer` gives."""
    if shape.activation == "sigmoid":
        return active * (1 - active)
    return (active > 0).to(active.dtype)


def fused_hidden_layer(shape: Shape, theta: Tensor, inputs: Tensor) -> Tensor:
    """The same as `hidden_layer`, written as a sum that a compiler fuses.

    Compiled, it never writes the activations to memory and is two to three times
    faster on large batches; not compiled, it is slower.

    Args:
        shape: sizes.
        theta: weights ``(R, D)``.
        inputs: ``(R, I, N)``.

    Returns:
        ``(R, G, H, N)``.
    """
    w1, b1, _, _ = shape.split(theta)
    total = b1 + w1[:, :, :1] * inputs[:, :1]
    for i in range(1, shape.inputs):
        total = total + w1[:, :, i : i + 1] * inputs[:, i : i + 1]
    active = total.sigmoid() if shape.activation == "sigmoid" else total.relu()
    return active.view(theta.shape[0], shape.groups, shape.hidden, -1)


def forward(
    shape: Shape, theta: Tensor, inputs: Tensor, *, fused: bool = False
) -> Tensor:
    """Scaled outputs of every network.

    Args:
        shape: sizes.
        theta: weights ``(R, D)``.
        inputs: scaled inputs ``(R, I, N)``.
        fused: use the form meant for compilation.

    Returns:
        ``(R, G, O, N)``.
    """
    _, _, w2, b2 = shape.split(theta)
    if not fused:
        return w2 @ hidden_layer(shape, theta, inputs) + b2
    active = fused_hidden_layer(shape, theta, inputs)
    heads = [(active * w2[:, :, head, :, None]).sum(2) for head in range(shape.outputs)]
    return torch.stack(heads, dim=2) + b2


def predict(
    shape: Shape, theta: Tensor, inputs: Tensor, *, fused: bool = False
) -> Tensor:
    """Scaled prediction: the three networks' outputs, or the ensemble's mean.

    Args:
        shape: sizes.
        theta: weights ``(R, D)``.
        inputs: scaled inputs ``(R, I, N)``.
        fused: use the form meant for compilation.

    Returns:
        ``(R, 3, N)``.
    """
    outputs = forward(shape, theta, inputs, fused=fused)
    if shape.outputs == 1:
        return outputs.squeeze(2)
    return outputs.mean(1)


def integrate(
    forward: Tensor,
    left: Tensor,
    turn: Tensor,
    start: tuple[float, float, float],
    dim: int = -1,
) -> tuple[Tensor, Tensor, Tensor]:
    """Compose body-frame displacements along one axis.

    Args:
        forward, left: displacements of each command [m], any equal shapes.
        turn: the same [rad].
        start: pose in the world frame [m, m, rad].
        dim: the axis along which commands follow each other.

    Returns:
        x, y [m] and yaw [rad] in the world frame after each command.
    """
    x, y, yaw = start
    after = yaw + turn.cumsum(dim)
    before = after - turn
    cos, sin = before.cos(), before.sin()
    px = x + (cos * forward - sin * left).cumsum(dim)
    py = y + (sin * forward + cos * left).cumsum(dim)
    return px, py, after
