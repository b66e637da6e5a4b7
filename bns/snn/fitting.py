"""Fitting stacked networks to patterns: the epochs between two trials."""

from collections.abc import Callable
from functools import partial
from typing import NamedTuple

from torch import Tensor

from bns.draws import Draws
from bns.learners.bns.config import SnnConfig
from bns.snn import training
from bns.snn.network import Shape, forward

Epoch = Callable[..., tuple[Tensor, training.RpropState]]


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
    return partial(training.epoch, shape, decay=config.weight_decay)


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
    state = training.RpropState.fresh(theta)
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
