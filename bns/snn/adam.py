"""Training by Adam on random parts of the patterns, all runs together.

For the walking SNN Rprop on all patterns costs more the longer a run is, and its step
sizes mistake the noise of dropout for a change of direction; Adam (Kingma and Ba 2015)
on parts of fixed size does neither. Each run draws from its own patterns.
"""

from typing import Any, NamedTuple

import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.experiment.config import RunConfig
from bns.snn.fitting import Patterns, dropout, mean_error
from bns.snn.network import Shape
from bns.snn.training import gradient

BETAS = (0.9, 0.999)  # torch.optim.Adam's defaults
EPSILON = 1e-8


class AdamState(NamedTuple):
    """First and second moments of every weight, each ``(R, D)``."""

    first: Tensor
    second: Tensor

    @classmethod
    def fresh(cls, theta: Tensor) -> "AdamState":
        """The state before the first step."""
        return cls(torch.zeros_like(theta), torch.zeros_like(theta))


def adam(
    theta: Tensor, grad: Tensor, state: AdamState, rate: Tensor, step: Tensor
) -> tuple[Tensor, AdamState]:
    """One step of Adam, as in `torch.optim.Adam`; steps count from 1.

    Args:
        theta: weights, ``(R, D)``.
        grad: their gradient, ``(R, D)``.
        state: moments before the step.
        rate: learning rate, of no dimension or broadcasting to `theta`.
        step: number of this step, from 1, of no dimension.

    Returns:
        weights and moments after the step.
    """
    first = torch.lerp(state.first, grad, 1 - BETAS[0])
    second = torch.lerp(state.second, grad.square(), 1 - BETAS[1])
    size = rate / (1 - BETAS[0] ** step)
    scale = second.sqrt() / (1 - BETAS[1] ** step) ** 0.5 + EPSILON
    return theta - size * first / scale, AdamState(first, second)


def fit(
    shape: Shape,
    config: RunConfig,
    theta: Tensor,
    patterns: Patterns,
    draws: Draws,
) -> tuple[Tensor, Tensor]:
    """Train all runs' networks; the rate falls to zero along half a cosine.

    The loss is that of `bns.snn.fitting.fit` divided by the number of patterns.

    Args:
        shape: of the networks.
        config: size of the parts, rate, dropout, decay.
        theta: weights ``(R, D)``.
        patterns: what to draw from.
        draws: of the parts and of the dropout.

    Returns:
        new weights, and the mean squared error on all patterns after training ``(R,)``.
    """
    inputs, targets, weight = patterns
    counts = weight.sum((1, 2, 3)).long()
    batch, off = config.walk.batch, config.snn.dropout
    steps, state = config.snn.epochs, AdamState.fresh(theta)
    decay = config.snn.weight_decay / counts.clamp(min=1)[:, None]
    some = (counts > 0).float()[:, None, None, None].expand(-1, 1, 1, batch)
    for number in range(steps):
        coins = draws.uniform(len(theta), batch)
        index = whole_below(coins, counts.clamp(min=1)[:, None])[:, None]
        shown = inputs.gather(2, index.expand(-1, inputs.shape[1], -1))
        wanted = targets.gather(2, index.expand(-1, targets.shape[1], -1))
        keep = dropout(shape, off, shown, draws) if off else None
        grad = _gradient(shape, theta, shown, wanted.unsqueeze(1), some, keep) / batch
        here = torch.tensor(number / steps)
        rate = config.walk.learning_rate * (1 + torch.cos(torch.pi * here)) / 2
        grad = grad + decay * theta
        theta, state = adam(theta, grad, state, rate, torch.tensor(number + 1.0))
    return theta, mean_error(shape, theta, patterns)


def _gradient(shape: Shape, theta: Tensor, *patterns: Any) -> Tensor:
    """As `gradient`; on a CPU run by run, since one run's activations fit its cache."""
    if theta.device.type != "cpu":
        return gradient(shape, theta, *patterns)
    parts = [[None] * len(theta) if p is None else p.split(1) for p in patterns]
    rows = zip(theta.split(1), *parts, strict=True)
    return torch.cat([gradient(shape, *row) for row in rows])
