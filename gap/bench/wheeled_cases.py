"""Recordings of a wheeled robot that departs from its model, for blind cases.

The "real" robot is the nominal model, itself slightly wrong, seen by a noisy tracker
with drop-outs and jitter.
"""

from collections.abc import Sequence

import numpy as np

from bns import models, seeding
from bns.gap.bench.cases import Stand
from bns.gap.models.base import GapModel
from bns.gap.planning import excitation
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.physics.wheeled_world import MujocoWorld
from bns.worlds.trial import Commands, Trial

TRIALS, LENGTH = 5, 8.0  # recordings of a case, and how long each is [s]


class WheeledStand(Stand):
    """A wheeled robot that cases are made of, see `Stand`.

    Args:
        model: nominal model.
        extra: further departures of reality (another solver).
    """

    kinds = ("single", "pair", "none", "fault")

    def __init__(self, model: GapModel, extra: Sequence[Effect] = ()):
        super().__init__(model)
        self.extra = tuple(extra)

    def commands(self, rng: np.random.Generator) -> list[Commands]:
        """See `Stand.commands`."""
        return commands(rng, robot=self.model.name)

    def imperfection(self, rng: np.random.Generator) -> list[Effect]:
        """See `Stand.imperfection`; the tracker's noise included."""
        return [*imperfection(rng), *self.extra, *tracker(rng)]

    def record(
        self, told: Sequence[Commands], effects: Sequence[Effect], seed: int
    ) -> tuple[Trial, ...]:
        """See `Stand.record`."""
        order = {"command": 0, "actuator": 1, "body": 2, "tracking": 3}
        effects = sorted(effects, key=lambda effect: order[effect.stage])
        return record(told, effects, seed, self.model.name)


def commands(
    rng: np.random.Generator, count: int = TRIALS, *, robot: str = "khepera3"
) -> list[Commands]:
    """Random wheel speeds that a robot takes, each held for 0.4 to 1.6 s.

    Args:
        rng: source of the speeds and times.
        count: number of lists of commands, one for each trial.
        robot: a wheeled robot, by name; its speed limit counts.
    """
    fastest = excitation.fastest(float(models.robot(robot).limits.min()))
    made = []
    for _ in range(count):
        number = int(rng.integers(5, 10))
        held = rng.uniform(0.4, 1.6, number)
        held = np.maximum(np.rint(held * LENGTH / held.sum() / 0.005), 20) * 0.005
        values = rng.uniform(-fastest, fastest, (number, 2))
        straight = rng.random(number) < 0.2
        values[straight, 1] = values[straight, 0]
        made.append(Commands(values, held))
    return made


def imperfection(rng: np.random.Generator) -> list[Effect]:
    """How a real robot departs from its model although nothing is wrong with it."""
    values: dict[str, list[dict[str, float | str]]] = {
        "wheel_diameter": [
            {"wheel": side, "factor": float(np.clip(rng.normal(1, 0.002), 0.99, 1.01))}
            for side in ("left", "right")
        ],
        "axle_length": [{"factor": float(np.clip(rng.normal(1, 0.004), 0.98, 1.02))}],
        "floor_friction": [{"factor": float(rng.uniform(0.8, 1.2))}],
        "centre_of_mass": [{"dx": float(rng.normal(0, 3e-4))}],
    }
    return [registry.make(name, **row) for name, rows in values.items() for row in rows]


def tracker(rng: np.random.Generator) -> list[Effect]:
    """Noise and drop-outs of an overhead tracker."""
    position = float(np.exp(rng.uniform(np.log(0.5e-3), np.log(2e-3))))
    heading = float(np.exp(rng.uniform(np.log(4e-3), np.log(15e-3))))
    noise = {"position_sd": position, "heading_sd": heading}
    made = [registry.make("tracker_noise", **noise)]
    if rng.random() < 0.5:
        share = float(rng.uniform(0.005, 0.05))
        made.append(registry.make("tracker_dropouts", probability=share))
    return made


def record(
    told: Sequence[Commands], effects: Sequence[Effect], seed: int, robot: str
) -> tuple[Trial, ...]:
    """Run the robot; time stamps jitter by a few milliseconds.

    Args:
        told: commands of each trial.
        effects: what the robot departs by.
        seed: of the world and of the jitter.
        robot: a wheeled robot, by name.
    """
    world = MujocoWorld(robot, reality=effects, threads=2, name="real")
    seeds = [seeding.integer(seed, "case", "world", n) for n in range(len(told))]
    made = []
    for number, trial in enumerate(world.run(told, seeds=seeds)):
        rng = seeding.generator(seed, "case", "jitter", number)
        times = trial.times + rng.normal(0, 1.5e-3, len(trial.times))
        times[0] = trial.times[0]
        observed = trial.observed.copy()
        lost = ~np.isfinite(observed[0])
        observed[0, lost] = 0.0  # the start is known
        made.append(
            trial.replace(
                times=np.maximum.accumulate(times), observed=observed, conditions={}
            )
        )
    return tuple(made)
