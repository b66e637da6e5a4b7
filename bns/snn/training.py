"""Training by Rprop on full batches, all runs together.

The gradient of a one-hidden-layer network is written out (tests compare it with
autograd's), and Rprop follows `torch.optim.Rprop` step for step (tests compare the
two), so that an epoch is a handful of batched products that torch can compile.
"""

from typing import NamedTuple

import torch
from torch import Tensor

from bns.snn.network import Shape, hidden_layer, slope

FIRST_STEP = 0.01  # torch.optim.Rprop's defaults
SHRINK, GROW = 0.5, 1.2
STEP_MIN, STEP_MAX = 1e-6, 50.0


class RpropState(NamedTuple):
    """Previous gradient and step size of every weight, each ``(R, D)``."""

    previous: Tensor
    step: Tensor

    @classmethod
    def fresh(cls, theta: Tensor) -> "RpropState":
        """The state before the first epoch."""
        return cls(torch.zeros_like(theta), torch.full_like(theta, FIRST_STEP))


def gradient(
    shape: Shape,
    theta: Tensor,
    inputs: Tensor,
    targets: Tensor,
    weight: Tensor,
    keep: Tensor | None = None,
) -> Tensor:
    """Gradient of half the weighted sum of squared errors.

    Args:
        shape: sizes.
        theta: weights ``(R, D)``.
        inputs: ``(R, I, N)``.
        targets: ``(R, G or 1, O, N)``.
        weight: of each pattern, ``(R, 1, 1, N)``; 0 leaves one out.
        keep: dropout factors of the hidden neurons ``(R, G, H, N)``, or None.

    Returns:
        ``(R, D)``.
    """
    runs = theta.shape[0]
    _, _, w2, b2 = shape.split(theta)
    active = hidden_layer(shape, theta, inputs)
    shown = active if keep is None else active * keep
    error = (w2 @ shown + b2 - targets) * weight
    back = (w2.transpose(2, 3) @ error) * slope(shape, active)
    if keep is not None:
        back = back * keep
    back = back.view(runs, shape.units, -1)
    parts = [
        back @ inputs.transpose(1, 2),
        back.sum(2),
        error @ shown.transpose(2, 3),
        error.sum(3),
    ]
    return torch.cat([part.reshape(runs, -1) for part in parts], dim=1)


def rprop(theta: Tensor, grad: Tensor, state: RpropState) -> tuple[Tensor, RpropState]:
    """One Rprop step (Riedmiller and Braun 1993, as in `torch.optim.Rprop`).

    Args:
        theta: weights, ``(R, D)``.
        grad: their gradient, ``(R, D)``.
        state: gradient and step sizes before.

    Returns:
        weights and state after the step.
    """
    agree = grad * state.previous
    factor = torch.where(agree > 0, GROW, torch.where(agree < 0, SHRINK, 1.0))
    step = (state.step * factor).clamp(STEP_MIN, STEP_MAX)
    grad = torch.where(agree < 0, 0.0, grad)
    return theta - grad.sign() * step, RpropState(grad, step)


def epoch(
    shape: Shape,
    theta: Tensor,
    state: RpropState,
    inputs: Tensor,
    targets: Tensor,
    weight: Tensor,
    keep: Tensor | None = None,
    decay: float = 0.0,
) -> tuple[Tensor, RpropState]:
    """One full-batch epoch.

    `decay` adds half of it times the squared weights to the loss: without, weights grow
    on data that repeat themselves, and the SNN errs by metres off the data.

    Args:
        shape: sizes.
        theta: weights ``(R, D)``.
        state: gradient and step sizes before.
        inputs, targets, weight, keep: as in `gradient`.
        decay: of the weights; 0 = none.

    Returns:
        weights and state after the epoch.
    """
    grad = gradient(shape, theta, inputs, targets, weight, keep)
    return rprop(theta, grad + decay * theta, state)
