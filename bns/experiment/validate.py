"""Bounds of every number in a configuration, and what must fit together."""

import math
from collections.abc import Iterator
from dataclasses import fields, is_dataclass
from typing import Any, NamedTuple

from bns.errors import BnsError, OutOfBoundsError
from bns.experiment.config import RunConfig
from bns.learners.bns.config import BNS_SECTIONS


class Bound(NamedTuple):
    """Smallest and largest value allowed, and their unit ("1" = a plain number)."""

    low: float
    high: float
    unit: str = "1"


_SPEED = "speed units"
BOUNDS = {
    "task.corner_x": Bound(0.05, 1.30, "m"),  # the board is 2.7 m x 1.8 m
    "task.corner_y": Bound(0.05, 0.85, "m"),
    "task.radius": Bound(0.005, 0.5, "m"),
    "task.penalty": Bound(0, 1e9),
    "task.command_cost": Bound(0, 1e6, "cm"),
    "task.start_yaw": Bound(-360, 360, "deg"),
    "controller.max_commands": Bound(1, 200, "commands"),
    "controller.initial_min": Bound(1, 200, "commands"),
    "controller.initial_max": Bound(1, 200, "commands"),
    "controller.speed_low": Bound(-43000, 43000, _SPEED),  # 0.3 m/s, assumed
    "controller.speed_high": Bound(-43000, 43000, _SPEED),
    "controller.dead_band": Bound(0, 43000, _SPEED),
    "controller.duration_low": Bound(0.05, 60, "s"),
    "controller.duration_high": Bound(0.05, 60, "s"),
    "evolution.population": Bound(2, 100_000, "individuals"),
    "evolution.generations": Bound(0, 100_000, "generations"),
    "evolution.tournament": Bound(1, 100_000, "individuals"),
    "evolution.crossover_points": Bound(1, 200, "cuts"),
    "evolution.sbx_eta": Bound(0, 1000),
    "evolution.mutation_rate": Bound(0, 1),
    "evolution.mutation_magnitude": Bound(0, 86000, _SPEED),
    "evolution.duration_magnitude": Bound(0, 60, "s"),
    "evolution.elitism": Bound(0, 100_000, "individuals"),
    "evolution.headless_chicken": Bound(0, 1),
    "evolution.cells": Bound(0, 100, "bins"),
    "snn.hidden": Bound(1, 4096, "neurons"),
    "snn.members": Bound(1, 100, "networks"),
    "snn.dropout": Bound(0, 0.95),
    "snn.epochs": Bound(0, 1_000_000, "epochs"),
    "snn.weight_decay": Bound(0, 1),
    "adaptation.window": Bound(0, 10_000_000, "patterns"),
    "adaptation.simulator_reset_every": Bound(0, 1_000_000, "trials"),
    "adaptation.mutation_rate_after": Bound(0, 1),
    "adaptation.mutation_magnitude_after": Bound(0, 86000, _SPEED),
    "light.ambient": Bound(0, 1000, "W/m2"),
    "light.goal": Bound(0.01, 10, "m"),
    "light.safety": Bound(0, 10, "m"),
    "light.start_nearest": Bound(0.05, 1.0, "m"),  # the board is 1.8 m wide
    "light.starts": Bound(1, 10_000, "starts"),
    "light.cycles": Bound(1, 100_000, "cycles"),
    "light.cycle": Bound(0.05, 60, "s"),
    "light.circle_cycles": Bound(1, 100_000, "cycles"),
    "light.circle_within": Bound(0, 10, "m"),
    "light.circle_sweep": Bound(0, 360_000, "deg"),
    "light.hidden": Bound(1, 4096, "neurons"),
    "light.weights": Bound(0, 1000),
    "light.weight_limit": Bound(0, 10_000),
    "light.mutation_magnitude": Bound(0, 1000),
    "light.noise": Bound(0, 100),
    "light.batch": Bound(0, 10_000_000, "patterns"),
    "light.islands": Bound(1, 10_000, "islands"),
    "light.migration_every": Bound(1, 1_000_000, "trials"),
    "light.migrants": Bound(0, 100_000, "individuals"),
    "light.renewed": Bound(0, 10_000, "islands"),
    "light.reset_every": Bound(0, 1_000_000, "trials"),
    "light.reset_elitists": Bound(0, 100_000, "individuals"),
    "walk.commands": Bound(1, 200, "commands"),
    "walk.limit": Bound(0.05, 60, "s"),
    "walk.initial": Bound(0, 3.2, "rad"),
    "walk.reach": Bound(0.01, 3.2, "rad"),
    "walk.coxa_reach": Bound(0, 3.2, "rad"),
    "walk.grow_from": Bound(0, 1_000_000, "trials"),
    "walk.grow_until": Bound(0, 1_000_000, "trials"),
    "walk.mutation_magnitude": Bound(0, 1023, "ticks"),
    "walk.repeat": Bound(0, 1),
    "walk.repeat_after": Bound(0, 1),
    "walk.doubt": Bound(0, 1000),
    "walk.batch": Bound(0, 100_000, "patterns"),
    "walk.learning_rate": Bound(1e-6, 1),
    "walk.passes": Bound(0, 100_000, "times"),
    "walk.pull": Bound(0, 1000),
    "walk.anchors": Bound(0, 100, "patterns"),
    "walk.adequate": Bound(0.001, 100, "m"),
    "watch.threshold": Bound(0, 1000),
    "watch.warmup": Bound(2, 1000, "trials"),
    "watch.history": Bound(2, 1000, "trials"),
    "watch.floor": Bound(1e-6, 1),
    "watch.grow": Bound(0, 1000),
    "watch.reach": Bound(0, 100),
    "watch.near": Bound(1, 1000, "patterns"),
    "watch.largest": Bound(1, 1000, "patterns"),
    "watch.forget_factor": Bound(0, 1000),
    "watch.forget_floor": Bound(1e-6, 1),
    "watch.forget_reach": Bound(0, 100),
    "watch.forget_least": Bound(1, 100_000, "patterns"),
    "prior.evaluations": Bound(1, 1_000_000_000, "executions"),
    "prior.step": Bound(0, 0.02, "s"),
    "world.sample_dt": Bound(0.005, 10, "s"),
    "choose_tournament": Bound(0, 1),
    "evolve_from": Bound(0, 1_000_000, "trials"),
    "trials": Bound(1, 1_000_000, "trials"),
    "replicates": Bound(1, 10_000, "runs"),
    "record_replicates": Bound(0, 10_000, "runs"),
    "seed": Bound(0, 2**63 - 1),
    "threads": Bound(1, 1024, "threads"),
}

_ORDERED = (
    ("controller.initial_min", "controller.initial_max"),
    ("controller.initial_max", "controller.max_commands"),
    ("controller.speed_low", "controller.speed_high"),
    ("controller.duration_low", "controller.duration_high"),
    ("evolution.tournament", "evolution.population"),
    ("evolution.elitism", "evolution.population"),
    ("walk.initial", "walk.reach"),
    ("walk.grow_from", "walk.grow_until"),
    ("watch.warmup", "watch.history"),
    ("light.safety", "light.goal"),
    ("light.circle_cycles", "light.cycles"),
    ("light.weights", "light.weight_limit"),
    ("light.islands", "evolution.population"),
    ("light.reset_elitists", "evolution.population"),
)


def leaves(config: Any, prefix: str = "") -> Iterator[tuple[str, Any]]:
    """Every setting of a configuration tree as (dotted name, value)."""
    for field in fields(config):
        value = getattr(config, field.name)
        if is_dataclass(value):
            yield from leaves(value, f"{prefix}{field.name}.")
        else:
            yield prefix + field.name, value


def check(config: RunConfig) -> RunConfig:
    """The configuration, if every number is inside its bounds and they fit together.

    Raises:
        OutOfBoundsError: a number outside its bounds, or not finite.
        BnsError: two settings that contradict each other.
    """
    values = dict(leaves(config))
    own = {f"settings.{n}": Bound(*b) for n, b in config.settings.bounds.items()}
    bounds = BOUNDS | own
    for name, value in values.items():
        if isinstance(value, bool) or not isinstance(value, int | float):
            continue
        bound = bounds.get(name, Bound(-math.inf, math.inf))
        if not (math.isfinite(value) and bound.low <= value <= bound.high):
            raise OutOfBoundsError(name, value, *bound)
    for lower, upper in _ORDERED:
        if values[lower] > values[upper]:
            raise BnsError(
                f"{lower} = {values[lower]} is larger than {upper} = {values[upper]}: "
                f"raise {upper} or lower {lower}."
            )
    check_choice(config)
    check_learner(config)
    return config


def check_learner(config: RunConfig) -> None:
    """Refuse settings of a learner that is not the configuration's.

    Raises:
        UnknownNameError: no such learner.
        BnsError: settings of another learner.
    """
    if config.learner == "bns":
        return
    from bns.learners import registry

    kind = registry.get(config.learner)
    if type(config.settings) is not kind.Settings:
        raise BnsError(
            f"These settings are not of learner = {config.learner!r}: make the "
            "configuration by bns.experiment.loading.with_learner."
        )
    usual = RunConfig()
    for name in BNS_SECTIONS:
        if name not in kind.sections and getattr(config, name) != getattr(usual, name):
            raise BnsError(
                f"`{name}` belongs to the learner 'bns', not to {config.learner!r}, "
                "which would not heed it: leave it out."
            )


def check_choice(config: RunConfig) -> None:
    """Refuse to choose by the disagreement of networks that can not disagree.

    Raises:
        BnsError: there is no ensemble.
    """
    if config.choose == "disagreement" and config.snn.kind != "ensemble":
        raise BnsError(
            "choose = 'disagreement' needs an ensemble; set snn.kind = 'ensemble'."
        )
