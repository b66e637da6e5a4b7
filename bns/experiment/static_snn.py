"""Training the dissertation's own fake real world: a static SNN (thesis 2.7, FRW1).

Random commands are executed in another world, and the three networks of Figure 4.4 are
fitted to what they did. The number of commands follows Pretorius, du Plessis and
Cilliers (2009): 5000. Slow speeds are commanded as well, since a damaged wheel turns
at speeds that no controller asks for.
"""

from dataclasses import replace
from functools import partial

import numpy as np
import torch

from bns import seeding
from bns.draws import Draws
from bns.evolution.chromosome import Encoding
from bns.experiment.config import RunConfig
from bns.learners.bns.config import SnnConfig
from bns.learners.bns.navigation import of_trial
from bns.snn import training
from bns.snn.network import Shape, predict
from bns.snn.scaling import Scaling
from bns.tasks import registry as tasks
from bns.worlds.static_snn import StaticNets
from bns.worlds.world import World

LISTS, PER_LIST = 200, 25  # 5000 commands
HELD_OUT = 20  # lists that judge the fit
EPOCHS = 3000


def nets_for(config: RunConfig) -> StaticNets:
    """Nets that imitate the undamaged MuJoCo world of a configuration's robot."""
    from bns.worlds import registry

    if tasks.kind(config.task.name) == "walk":
        from bns.experiment import static_walk

        return static_walk.nets_for(config)
    source = registry.make("mujoco", robot=config.world.robot, threads=config.threads)
    return fit(source, config)


def fit(
    source: World,
    config: RunConfig,
    *,
    lists: int = LISTS,
    epochs: int = EPOCHS,
) -> StaticNets:
    """Fit static nets to a world.

    Args:
        source: where the random commands are executed.
        config: bounds of commands and durations, seed, threads.
        lists: lists of `PER_LIST` random commands; the last tenth is held out.
        epochs: Rprop epochs.

    Returns:
        The nets; `provenance` holds the held-out RMS errors [m, m, rad].
    """
    torch.set_num_threads(config.threads)
    draws = Draws(seeding.integer(config.seed, "static-snn"))
    encoding = _slow_too(config)
    scaling = Scaling.of(encoding)
    sent = encoding.individuals(
        draws.uniform(lists, 1, PER_LIST, 3), torch.zeros(lists, 1)
    )
    seeds = [seeding.integer(config.seed, "static-snn", i) for i in range(lists)]
    pairs = [
        of_trial(trial)
        for trial in source.run(encoding.commands(sent), trial=0, seeds=seeds)
    ]
    held = max(1, lists * HELD_OUT // LISTS)
    shape = Shape.of(SnnConfig())
    theta = _train(shape, scaling, pairs[:-held], epochs, draws)
    miss = _errors(shape, theta, scaling, pairs[-held:])
    provenance = {
        "source": source.name,
        "robot": source.robot,
        "commands": sum(len(commands) for commands, _ in pairs[:-held]),
        "epochs": epochs,
        "held_out_rms": [float(round(value, 6)) for value in miss],
    }
    return _static(shape, theta, scaling, provenance)


def _slow_too(config: RunConfig) -> Encoding:
    """The configuration's encoding from standstill on, lists of one length."""
    low = min(0.0, config.controller.speed_low)
    wide = replace(
        config.controller,
        speed_low=low,
        dead_band=0.0,
        max_commands=PER_LIST,
        fixed_length=True,
    )
    return Encoding.of(wide)


def _tensors(
    scaling: Scaling, pairs: list[tuple[np.ndarray, np.ndarray]]
) -> tuple[torch.Tensor, torch.Tensor]:
    commands = torch.from_numpy(np.concatenate([c for c, _ in pairs])).float()
    moved = torch.from_numpy(np.concatenate([m for _, m in pairs])).float()
    inputs = (commands - scaling.centre) / scaling.half
    return inputs.T[None].contiguous(), (moved / scaling.output).T[None, :, None]


def _train(
    shape: Shape,
    scaling: Scaling,
    pairs: list[tuple[np.ndarray, np.ndarray]],
    epochs: int,
    draws: Draws,
) -> torch.Tensor:
    inputs, targets = _tensors(scaling, pairs)
    theta = shape.random(1, draws)
    state = training.RpropState.fresh(theta)
    weight = torch.ones(1, 1, 1, inputs.shape[2])
    step = partial(training.epoch, shape)
    for _ in range(epochs):
        theta, state = step(theta, state, inputs, targets, weight)
    return theta


def _errors(
    shape: Shape,
    theta: torch.Tensor,
    scaling: Scaling,
    pairs: list[tuple[np.ndarray, np.ndarray]],
) -> np.ndarray:
    inputs, targets = _tensors(scaling, pairs)
    miss = (predict(shape, theta, inputs) - targets[:, :, 0]).square().mean(2).sqrt()
    return (miss[0] * scaling.output).numpy().astype(np.float64)


def _static(
    shape: Shape, theta: torch.Tensor, scaling: Scaling, provenance: dict[str, object]
) -> StaticNets:
    """The weights in the form of a world: input offsets folded into the biases."""
    w1, b1, w2, b2 = (part[0].numpy().astype(np.float64) for part in shape.split(theta))
    half = scaling.half.numpy().astype(np.float64)
    centre = scaling.centre.numpy().astype(np.float64)
    shifted = b1[:, 0] - w1 @ (centre / half)
    return StaticNets(
        w1=w1.reshape(shape.groups, shape.hidden, -1).transpose(0, 2, 1),
        b1=shifted.reshape(shape.groups, shape.hidden),
        w2=w2[:, 0],
        b2=b2[:, 0, 0],
        input_scale=1.0 / half,
        output_scale=scaling.output.numpy().astype(np.float64),
        provenance=provenance,
    )
