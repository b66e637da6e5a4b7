"""Recordings of a walking robot that departs from its model, for blind cases.

The robot walks short stretches of tripod gaits that are drawn for each case. It is
itself a little different from its model; the tracker is noisy and servos report in
steps.
"""

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from bns import seeding
from bns.errors import BnsError
from bns.gap.bench.cases import Stand
from bns.gap.candidates import legged
from bns.gap.decomposition.problem import Problem
from bns.gap.decomposition.row import Row
from bns.gap.models.legged.model import TRACKER, WalkModel
from bns.gap.models.legged.signs import Signs, Suspects
from bns.models.legs import LEGS, PARTS, joints_of, names, parts
from bns.models.phantomx import gait
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.physics.legged_world import HexapodWorld
from bns.worlds.trial import Channel, Commands, Trial

TRIALS, COMMANDS = 2, 2  # recordings of a case, and commands in each
LIMIT = 1.0  # [s] of a command
SAMPLE = 0.04  # [s] between samples
LARGE = (3.3, 10.0)  # sizes of effects that have to be named
POSTURE = 0.4  # [rad] from the middle that joints are told at random; assumed
REST = (-0.4, 0.4)  # [rad] where a joint is locked


class WalkStand(Stand):
    """A walking robot that cases are made of, see `Stand`.

    Args:
        model: nominal model.
    """

    kinds = ("single", "large", "lost", "none")

    def __init__(self, model: WalkModel):
        super().__init__(model)
        self.walker = model

    def commands(self, rng: np.random.Generator) -> list[Commands]:
        """See `Stand.commands`."""
        return commands(rng, self.walker)

    def imperfection(self, rng: np.random.Generator) -> list[Effect]:
        """See `Stand.imperfection`."""
        return imperfection(rng, parts(self.walker.joints)[-1])

    def record(
        self, told: Sequence[Commands], effects: Sequence[Effect], seed: int
    ) -> tuple[Trial, ...]:
        """See `Stand.record`.

        Raises:
            BnsError: it does not stand, or falls.
        """
        trials = record(told, effects, seed, self.model.name)
        if any(trial.outcome.diverged or trial.outcome.fell for trial in trials):
            raise BnsError("The robot falls.")
        return trials

    def pool(
        self, rng: np.random.Generator, problem: Problem, kind: str
    ) -> Sequence[Row]:
        """Rows on a joint and a leg that are drawn, and on all; or losses.

        Args:
            rng: the only source of randomness.
            problem: a recording without an effect.
            kind: of case.
        """
        joints = self.walker.joints
        legs = names(joints)
        joint = joints[int(rng.integers(len(joints)))]
        leg = legs[int(rng.integers(len(legs)))]
        if kind == "lost":
            held = {name: float(rng.uniform(*REST)) for name in joints_of(leg, joints)}
            return self._whole(Signs(held, (leg,), (leg,), (leg,)))
        found = legged.rows(Suspects((joint,), (leg,), True), joints)
        mine = [
            row
            for row in found
            if not any(other in row.name for other in LEGS if other != leg)
            or joint in row.name
        ]
        return self.walker.remembered(mine)

    def _whole(self, signs: Signs) -> Sequence[Row]:
        """Losses of a whole leg or joint."""
        lost = self.walker.remembered(legged.lost(signs))
        return [replace(row, stepped=True, levels=(1.0,)) for row in lost]


def commands(rng: np.random.Generator, model: WalkModel) -> list[Commands]:
    """Tripod gaits of other strides, lifts and heights, forward and backward.

    Robots of one's own are told postures at random.
    """
    channels = tuple(Channel(name, row[2]) for name, row in model.limits.items())
    low, high = np.array([row[:2] for row in model.limits.values()]).T
    made: list[Commands] = []
    for number in range(TRIALS):
        heading = 1 if number % 2 == 0 else -1
        if model.name == "phantomx":
            goals = gait.drawn(rng, commands=COMMANDS, heading=heading)
        else:
            goals = rng.uniform(-POSTURE, POSTURE, (COMMANDS, len(channels)))
            goals = np.clip(goals, low, high)
        made.append(Commands(goals, np.full(COMMANDS, LIMIT), channels))
    return made


def imperfection(rng: np.random.Generator, shin: str = PARTS[-1]) -> list[Effect]:
    """How a real walker departs from its model although nothing is wrong; assumed.

    Args:
        rng: the only source of randomness.
        shin: the outermost part of its legs.
    """
    rows: tuple[tuple[str, dict[str, float | str]], ...] = (
        ("servo_gain", {"factor": rng.normal(1, 0.03)}),
        ("link_length", {"part": shin, "factor": rng.normal(1, 0.004)}),
        ("foot_slippery", {"factor": float(np.clip(rng.normal(1, 0.1), 0.7, 1.3))}),
        ("payload", {"mass": abs(rng.normal(0, 0.02))}),
    )
    return [
        registry.make(
            name, **{k: v if k == "part" else float(v) for k, v in row.items()}
        )
        for name, row in rows
    ]


def record(
    told: Sequence[Commands],
    effects: Sequence[Effect],
    seed: int,
    robot: str = "phantomx",
) -> tuple[Trial, ...]:
    """Let the robot walk, seen by a noisy tracker.

    Args:
        told: commands of each trial.
        effects: what the robot departs by; the tracker's noise is added.
        seed: of the world.
        robot: a walking robot, by name.
    """
    noise = registry.make(
        "tracker_noise", position_sd=TRACKER[0], heading_sd=TRACKER[2]
    )
    world = HexapodWorld(
        robot, reality=[*effects, noise], threads=1, sample_dt=SAMPLE, name="real"
    )
    seeds = [seeding.integer(seed, "walk case", n) for n in range(len(told))]
    made = world.run(told, seeds=seeds)
    return tuple(trial.replace(conditions={}) for trial in made)
