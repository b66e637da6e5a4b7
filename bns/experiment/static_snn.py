"""Training the dissertation's own fake real world: a static SNN (thesis 2.7, FRW1).

Random commands are executed in another world, and the three networks of Figure 4.4 are
fitted to what they did. The number of commands follows Pretorius, du Plessis and
Cilliers (2009): 5000. Slow speeds are commanded as well, since a damaged wheel turns
at speeds that no controller asks for.

Walking robots are told random goals, in a part of the lists with some legs held up,
since a damaged leg takes a pose that no controller asks for; one network with rectified
units is fitted to what the commands did.
"""

from dataclasses import replace
from functools import partial
from typing import Any

import numpy as np
import torch

from bns import seeding
from bns.draws import Draws
from bns.evolution.chromosome import Encoding
from bns.evolution.goals import Goals
from bns.experiment.config import RunConfig
from bns.learners.bns import navigation, walking
from bns.learners.bns.config import SnnConfig
from bns.learners.bns.walking import GOAL, MOVED
from bns.models.legs import parts
from bns.snn import training
from bns.snn.network import OUTPUTS, Scaling, Shape, forward, predict
from bns.snn.training import Patterns
from bns.tasks import registry as tasks
from bns.worlds.effects.legs import RAISED
from bns.worlds.static_snn import StaticNets
from bns.worlds.trial import Commands
from bns.worlds.world import World

LISTS, PER_LIST = 200, 25  # 5000 commands
HELD_OUT = 20  # lists that judge the fit
EPOCHS = 3000


def nets_for(config: RunConfig) -> StaticNets:
    """Nets that imitate the undamaged MuJoCo world of a configuration's robot."""
    from bns.worlds import registry

    told: dict[str, Any] = {"robot": config.world.robot, "threads": config.threads}
    if tasks.kind(config.task.name) == "walk":
        return fit_walker(registry.make("hexapod", **told), config)
    return fit(registry.make("mujoco", **told), config)


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
        navigation.of_trial(trial)
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


WALKS = 450  # of as many commands as a controller has: 5000, as for wheels
WALKS_HELD_OUT = 0.1  # share of the lists that judges the fit
RAISING = 0.5  # share of the lists in which legs are up
MOST_UP = 4  # legs
SMALLEST = 0.3  # of the reach, within which the goals of a list lie
HIDDEN, STEPS, PART, DECAY = 400, 4000, 256, 1.0


def fit_walker(
    source: World, config: RunConfig, *, lists: int = WALKS, steps: int = STEPS
) -> StaticNets:
    """Fit static nets to a world.

    Args:
        source: where the random commands are executed.
        config: bounds of goals, limits of commands, seed, threads.
        lists: of random commands; the last tenth is held out.
        steps: of Adam.

    Returns:
        The nets; `provenance` holds what they explain of the held-out displacements
        (1 less the share of the variance), forward, left and turn.
    """
    torch.set_num_threads(config.threads)
    tried = walker_commands(config, lists)
    seeds = [seeding.integer(config.seed, "static-snn", i) for i in range(lists)]
    pairs = [
        walking.of_trial(trial) for trial in source.run(tried, trial=0, seeds=seeds)
    ]
    held = max(1, round(lists * WALKS_HELD_OUT))
    theta, shape = _trained_walker(pairs[:-held], config, steps)
    provenance = {
        "source": source.name,
        "robot": source.robot,
        "commands": sum(len(seen) for seen, _ in pairs[:-held]),
        "steps": steps,
        "held_out_explained": _explained(shape, theta, pairs[-held:]),
    }
    return _walker_nets(shape, theta, provenance)


def walker_commands(config: RunConfig, lists: int) -> list[Commands]:
    """Random goals around half-way, legs held up in a part of the lists."""
    goals = Goals.of(config)
    rng = seeding.generator(config.seed, "static-snn", "goals")
    low, high = goals.low.numpy().astype(float), goals.high.numpy().astype(float)
    pose = [RAISED[part] for part in parts(item.name for item in goals.channels)]
    ends = goals.ranges.T
    made = []
    for _ in range(lists):
        shape = (goals.max_commands, len(goals.channels))
        values = rng.uniform(low, high, shape) * rng.uniform(SMALLEST, 1.0)
        if rng.random() < RAISING:
            legs = values.reshape(shape[0], -1, len(pose))
            up = rng.choice(legs.shape[1], rng.integers(1, MOST_UP + 1), replace=False)
            legs[:, up] = pose
        limits = np.full(shape[0], goals.limit)
        made.append(Commands(values.clip(*ends), limits, goals.channels))
    return made


def _walker_tensors(pairs: list) -> tuple[torch.Tensor, torch.Tensor]:
    """Inputs ``(1, I, N)`` and scaled displacements ``(1, 3, N)``."""
    seen = np.concatenate([inputs for inputs, _ in pairs]).astype(np.float32)
    moved = np.concatenate([moved for _, moved in pairs]) / np.array(MOVED)
    inputs, targets = (
        torch.from_numpy(np.ascontiguousarray(item))[None]
        for item in (seen.T, moved.T.astype(np.float32))
    )
    return inputs, targets


def _trained_walker(
    pairs: list, config: RunConfig, steps: int
) -> tuple[torch.Tensor, Shape]:
    inputs, targets = _walker_tensors(pairs)
    shape = Shape(1, HIDDEN, OUTPUTS, inputs.shape[1], "relu")
    config = replace(
        config,
        snn=replace(config.snn, epochs=steps, dropout=0.0, weight_decay=DECAY),
        walk=replace(config.walk, batch=PART),
    )
    draws = Draws(seeding.integer(config.seed, "static-snn"))
    known = Patterns(inputs, targets, torch.ones(1, 1, 1, inputs.shape[2]))
    theta, _ = training.fit_adam(shape, config, shape.random(1, draws), known, draws)
    return theta, shape


def _explained(shape: Shape, theta: torch.Tensor, pairs: list) -> list[float]:
    inputs, targets = _walker_tensors(pairs)
    miss = (forward(shape, theta, inputs)[0, 0] - targets[0]).square().mean(1)
    there = targets[0].var(1, unbiased=False)
    left = torch.where(there > 0, miss / there, 0.0)  # nothing to explain: explained
    return [round(1 - float(share), 4) for share in left]


def _walker_nets(
    shape: Shape, theta: torch.Tensor, provenance: dict[str, object]
) -> StaticNets:
    """The network as three that share their hidden neurons."""
    w1, b1, w2, b2 = (part[0].numpy().astype(np.float64) for part in shape.split(theta))
    return StaticNets(
        w1=np.tile(w1.T, (OUTPUTS, 1, 1)),
        b1=np.tile(b1[:, 0], (OUTPUTS, 1)),
        w2=w2[0],
        b2=b2[0, :, 0],
        input_scale=np.full(shape.inputs, 1.0 / GOAL),
        output_scale=np.array(MOVED),
        provenance=provenance,
        activation="relu",
    )
