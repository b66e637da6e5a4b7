"""Training of stacked networks on their patterns, all runs together.

By Rprop on all patterns: the gradient of a one-hidden-layer network is written out
(tests compare it with autograd's), and Rprop follows `torch.optim.Rprop` step for step
(tests compare the two), so that an epoch is a handful of batched products that torch
can compile.

By Adam on random parts of the patterns: for the walking SNN Rprop costs more the longer
a run is, and its step sizes mistake the noise of dropout for a change of direction;
Adam (Kingma and Ba 2015) on parts of fixed size does neither. Each run draws from its
own patterns.
"""

from collections.abc import Callable
from functools import partial
from typing import Any, NamedTuple

import torch
from torch import Tensor

from bns.draws import Draws, whole_below
from bns.experiment.config import RunConfig
from bns.learners.bns.config import SnnConfig
from bns.snn.network import Shape, forward, hidden_layer, slope

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


Epoch = Callable[..., tuple[Tensor, RpropState]]


class Patterns(NamedTuple):
    """What R runs train on.

    Attributes:
        inputs: scaled, ``(R, I, N)``.
        targets: scaled, ``(R, O, N)``.
        weight: 1 for a pattern, 0 for padding, ``(R, 1, 1, N)``.
    """

    inputs: Tensor
    targets: Tensor
    weight: Tensor


def epoch_of(shape: Shape, config: SnnConfig) -> Epoch:
    """The epoch of a configuration, ready to be compiled."""
    return partial(epoch, shape, decay=config.weight_decay)


def fit(
    shape: Shape,
    config: SnnConfig,
    theta: Tensor,
    patterns: Patterns,
    draws: Draws,
    epoch: Epoch,
) -> tuple[Tensor, Tensor]:
    """Train all runs' networks from fresh step sizes.

    Args:
        shape: of the networks.
        config: says for how many epochs, and how much dropout an ensemble has.
        theta: weights ``(R, D)``.
        patterns: what to train on.
        draws: of the dropout.
        epoch: `epoch_of`, compiled or not.

    Returns:
        new weights, and the mean squared error after training ``(R,)``.
    """
    inputs, targets, weight = patterns
    shaped = targets.unsqueeze(2) if shape.outputs == 1 else targets.unsqueeze(1)
    drop = config.kind == "ensemble" and config.dropout > 0
    state = RpropState.fresh(theta)
    for _ in range(config.epochs):
        keep = dropout(shape, config.dropout, inputs, draws) if drop else None
        theta, state = epoch(theta, state, inputs, shaped, weight, keep)
    return theta, mean_error(shape, theta, patterns)


def mean_error(shape: Shape, theta: Tensor, patterns: Patterns) -> Tensor:
    """Mean squared error of scaled outputs on all patterns, ``(R,)``.

    Args:
        shape: of the networks.
        theta: weights ``(R, D)``.
        patterns: scaled; padding counts nothing.
    """
    inputs, targets, weight = patterns
    shaped = targets.unsqueeze(2) if shape.outputs == 1 else targets.unsqueeze(1)
    error = (forward(shape, theta, inputs) - shaped) * weight
    count = weight.sum((1, 2, 3)).clamp(min=1.0)
    heads = shape.groups * shape.outputs
    return error.square().sum((1, 2, 3)) / (count * heads)


def dropout(shape: Shape, rate: float, inputs: Tensor, draws: Draws) -> Tensor:
    """Factors of the hidden neurons: 0, or 1 / (1 - rate).

    Args:
        shape: of the networks.
        rate: probability that a neuron is dropped, below 1.
        inputs: of the networks, ``(R, I, N)``; only their shape counts.
        draws: source of randomness.

    Returns:
        ``(R, G, H, N)``.
    """
    runs, _, patterns = inputs.shape
    coins = draws.uniform(runs, shape.groups, shape.hidden, patterns)
    return (coins >= rate).float() / (1.0 - rate)


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


def fit_adam(
    shape: Shape,
    config: RunConfig,
    theta: Tensor,
    patterns: Patterns,
    draws: Draws,
) -> tuple[Tensor, Tensor]:
    """Train all runs' networks; the rate falls to zero along half a cosine.

    Runs that take fewer steps than others (`walk.passes`) rest while these go on. The
    loss is that of `fit` divided by the number of patterns.

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
    steps, own = config.snn.epochs, _steps(config, counts)
    most, state = steps if own is None else int(own.max()), AdamState.fresh(theta)
    decay = config.snn.weight_decay / counts.clamp(min=1)[:, None]
    some = (counts > 0).float()[:, None, None, None].expand(-1, 1, 1, batch)
    for number in range(most):
        coins = draws.uniform(len(theta), batch)
        index = whole_below(coins, counts.clamp(min=1)[:, None])[:, None]
        shown = inputs.gather(2, index.expand(-1, inputs.shape[1], -1))
        wanted = targets.gather(2, index.expand(-1, targets.shape[1], -1))
        keep = dropout(shape, off, shown, draws) if off else None
        grad = (
            _gradient_by_run(shape, theta, shown, wanted.unsqueeze(1), some, keep)
            / batch
        )
        here = torch.tensor(number / steps) if own is None else number / own
        rate = torch.cos(torch.pi * here.clamp(max=1.0))
        rate = config.walk.learning_rate * (1 + rate) / 2
        grad = grad + decay * theta
        theta, state = adam(theta, grad, state, rate, torch.tensor(number + 1.0))
    return theta, mean_error(shape, theta, patterns)


def _steps(config: RunConfig, counts: Tensor) -> Tensor | None:
    """Steps of each run's training, ``(R, 1)``; None where all take as many."""
    if not config.walk.passes:
        return None
    steps = (config.walk.passes * counts / config.walk.batch).ceil()
    return steps.clamp(min=1)[:, None]


def _gradient_by_run(shape: Shape, theta: Tensor, *patterns: Any) -> Tensor:
    """As `gradient`; on a CPU run by run, since one run's activations fit its cache."""
    if theta.device.type != "cpu":
        return gradient(shape, theta, *patterns)
    parts = [[None] * len(theta) if p is None else p.split(1) for p in patterns]
    rows = zip(theta.split(1), *parts, strict=True)
    return torch.cat([gradient(shape, *row) for row in rows])
