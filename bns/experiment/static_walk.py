"""Training a static SNN for walking robots: fixed networks as their world.

Random goals are executed in another world, in a part of the lists with some legs held
up, since a damaged leg takes a pose that no controller asks for; one network with
rectified units is fitted to what the commands did. As `bns.experiment.static_snn`, for
wheels.
"""

from dataclasses import replace

import numpy as np
import torch

from bns import seeding
from bns.draws import Draws
from bns.evolution.goals import Goals
from bns.experiment.config import RunConfig
from bns.learners.bns.walking import GOAL, MOVED, of_trial
from bns.models.legs import parts
from bns.snn import adam
from bns.snn.fitting import Patterns
from bns.snn.network import Shape, forward
from bns.snn.scaling import OUTPUTS
from bns.worlds.effects.legs import RAISED
from bns.worlds.static_snn import StaticNets
from bns.worlds.trial import Commands
from bns.worlds.world import World

LISTS = 450  # of as many commands as a controller has: 5000, as for wheels
HELD_OUT = 0.1  # share of the lists that judges the fit
RAISING = 0.5  # share of the lists in which legs are up
MOST_UP = 4  # legs
SMALLEST = 0.3  # of the reach, within which the goals of a list lie
HIDDEN, STEPS, PART, DECAY = 400, 4000, 256, 1.0


def nets_for(config: RunConfig) -> StaticNets:
    """Nets that imitate the undamaged physics world of a configuration's robot."""
    from bns.worlds import registry

    source = registry.make("hexapod", robot=config.world.robot, threads=config.threads)
    return fit(source, config)


def fit(
    source: World, config: RunConfig, *, lists: int = LISTS, steps: int = STEPS
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
    tried = commands(config, lists)
    seeds = [seeding.integer(config.seed, "static-snn", i) for i in range(lists)]
    pairs = [of_trial(trial) for trial in source.run(tried, trial=0, seeds=seeds)]
    held = max(1, round(lists * HELD_OUT))
    theta, shape = _trained(pairs[:-held], config, steps)
    provenance = {
        "source": source.name,
        "robot": source.robot,
        "commands": sum(len(seen) for seen, _ in pairs[:-held]),
        "steps": steps,
        "held_out_explained": _explained(shape, theta, pairs[-held:]),
    }
    return _static(shape, theta, provenance)


def commands(config: RunConfig, lists: int) -> list[Commands]:
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


def _tensors(pairs: list) -> tuple[torch.Tensor, torch.Tensor]:
    """Inputs ``(1, I, N)`` and scaled displacements ``(1, 3, N)``."""
    seen = np.concatenate([inputs for inputs, _ in pairs]).astype(np.float32)
    moved = np.concatenate([moved for _, moved in pairs]) / np.array(MOVED)
    inputs, targets = (
        torch.from_numpy(np.ascontiguousarray(item))[None]
        for item in (seen.T, moved.T.astype(np.float32))
    )
    return inputs, targets


def _trained(pairs: list, config: RunConfig, steps: int) -> tuple[torch.Tensor, Shape]:
    inputs, targets = _tensors(pairs)
    shape = Shape(1, HIDDEN, OUTPUTS, inputs.shape[1], "relu")
    config = replace(
        config,
        snn=replace(config.snn, epochs=steps, dropout=0.0, weight_decay=DECAY),
        walk=replace(config.walk, batch=PART),
    )
    draws = Draws(seeding.integer(config.seed, "static-snn"))
    known = Patterns(inputs, targets, torch.ones(1, 1, 1, inputs.shape[2]))
    theta, _ = adam.fit(shape, config, shape.random(1, draws), known, draws)
    return theta, shape


def _explained(shape: Shape, theta: torch.Tensor, pairs: list) -> list[float]:
    inputs, targets = _tensors(pairs)
    miss = (forward(shape, theta, inputs)[0, 0] - targets[0]).square().mean(1)
    there = targets[0].var(1, unbiased=False)
    left = torch.where(there > 0, miss / there, 0.0)  # nothing to explain: explained
    return [round(1 - float(share), 4) for share in left]


def _static(
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
