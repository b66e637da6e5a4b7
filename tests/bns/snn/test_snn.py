"""The SNN: gradients, Rprop, known systems."""

import pytest
import torch

from bns.draws import Draws
from bns.evolution.chromosome import Encoding
from bns.experiment.task_settings import ControllerConfig
from bns.learners.bns.config import SnnConfig
from bns.snn import training
from bns.snn.network import Scaling, Shape, forward, predict

KINDS = [SnnConfig(), SnnConfig(kind="ensemble", members=4, hidden=7)]


def problem(config: SnnConfig, runs: int = 2, patterns: int = 30):
    shape, draws = Shape.of(config), Draws(0)
    theta = shape.random(runs, draws)
    inputs = 2 * draws.uniform(runs, 5, patterns) - 1
    targets = draws.uniform(runs, 3, patterns)
    shaped = targets.unsqueeze(2) if shape.outputs == 1 else targets.unsqueeze(1)
    return shape, theta, inputs, shaped, torch.ones(runs, 1, 1, patterns)


@pytest.mark.parametrize("config", KINDS, ids=lambda c: c.kind)
@pytest.mark.parametrize("dropout", [False, True])
def test_gradient_is_that_of_autograd(config, dropout):
    shape, theta, inputs, targets, weight = problem(config)
    weight[:, ..., 20:] = 0
    keep = None
    if dropout:
        size = (2, shape.groups, shape.hidden, 30)
        keep = (Draws(1).uniform(*size) < 0.8).float() / 0.8
    ours = training.gradient(shape, theta, inputs, targets, weight, keep)
    leaf = theta.clone().requires_grad_()
    w1, b1, w2, b2 = shape.split(leaf)
    active = torch.sigmoid(w1 @ inputs + b1)
    active = active.view(2, shape.groups, shape.hidden, -1)
    shown = active if keep is None else active * keep
    (0.5 * ((w2 @ shown + b2 - targets) ** 2 * weight).sum()).backward()
    torch.testing.assert_close(ours, leaf.grad, rtol=1e-4, atol=1e-5)


def test_rprop_is_torch_s_step_for_step():
    shape, theta, inputs, targets, weight = problem(KINDS[0])
    leaf = theta.clone().requires_grad_()
    reference = torch.optim.Rprop([leaf])
    state = training.RpropState.fresh(theta)
    for _ in range(25):
        grad = training.gradient(shape, leaf.detach(), inputs, targets, weight)
        leaf.grad = grad.clone()
        reference.step()
        theta, state = training.rprop(theta, grad, state)
        torch.testing.assert_close(theta, leaf.detach(), rtol=0, atol=0)


@pytest.mark.parametrize("config", KINDS, ids=lambda c: c.kind)
def test_compiled_form_agrees(config):
    shape, theta, inputs, _, _ = problem(config)
    torch.testing.assert_close(
        forward(shape, theta, inputs, fused=True), forward(shape, theta, inputs)
    )


@pytest.mark.parametrize("config", KINDS, ids=lambda c: c.kind)
def test_learns_a_known_linear_system(config):
    shape, theta, inputs, _, weight = problem(config, patterns=100)
    mixing = torch.tensor([[0.2, -0.1, 0.3, 0.3, 0.1]] * 3) * torch.tensor(
        [[1.0], [0.5], [-1.0]]
    )
    truth = mixing @ inputs
    shaped = truth.unsqueeze(2) if shape.outputs == 1 else truth.unsqueeze(1)
    state = training.RpropState.fresh(theta)
    for _ in range(400):
        theta, state = training.epoch(shape, theta, state, inputs, shaped, weight)
    fresh = 2 * Draws(9).uniform(2, 5, 50) - 1
    miss = predict(shape, theta, fresh) - mixing @ fresh
    assert miss.square().mean().sqrt() < 0.02


def test_runs_do_not_mix():
    shape, theta, inputs, targets, weight = problem(KINDS[0])
    state = training.RpropState.fresh(theta)
    both, _ = training.epoch(shape, theta, state, inputs, targets, weight)
    alone, _ = training.epoch(
        shape,
        theta[:1],
        training.RpropState.fresh(theta[:1]),
        inputs[:1],
        targets[:1],
        weight[:1],
    )
    torch.testing.assert_close(both[:1], alone)


def test_inputs_carry_the_previous_command():
    encoding = Encoding.of(ControllerConfig())
    scaling = Scaling.of(encoding)
    top, longest = encoding.high[0].item(), encoding.high[2].item()
    decoded = torch.tensor([[[top, 0.0, longest], [0.0, top, longest]]])
    assert scaling.inputs(decoded)[0].tolist() == pytest.approx(
        torch.tensor([[0.0, 0, 1, 0, 1], [1, 0, 0, 1, 1]])
    )
