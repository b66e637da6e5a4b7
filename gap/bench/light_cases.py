"""Recordings of robots that see, whose sensors depart from their model.

Robots drive by what they see, and at random, in the light world. The sensors of the
"real" robot differ a little from the nominal ones, and the tracker is noisy.
"""

from collections.abc import Sequence

import numpy as np

from bns import seeding
from bns.gap.bench import wheeled_cases
from bns.gap.bench.cases import Stand
from bns.gap.decomposition.problem import Problem
from bns.gap.models.base import GapModel
from bns.gap.models.light.diagnosis import unhandled
from bns.gap.models.light.model import SightModel
from bns.worlds.effects import registry
from bns.worlds.effects.base import Effect
from bns.worlds.effects.sensors import SINGLE
from bns.worlds.light.world import LightWorld
from bns.worlds.trial import Commands, Trial

TRIALS, CYCLES = 3, 40  # recordings of a case, and commands of 0.4 s in each


class LightStand(Stand):
    """A robot that sees, of which cases are made, see `Stand`.

    Args:
        model: nominal model of its motion.
        singles: whether single sensors are recorded, else the virtual two.
        wheels: whether effects on the wheels are hidden, not on what it sees.
    """

    kinds = ("single", "none", "off-library")

    def __init__(self, model: GapModel, *, singles: bool, wheels: bool = False):
        super().__init__(model)
        self.motion, self.singles, self.wheels = model, singles, wheels
        self.pose_sd = (0.0, 0.0, 0.0)

    def commands(self, rng: np.random.Generator) -> list[Commands]:
        """None: it drives by what it sees."""
        del rng
        return []

    def imperfection(self, rng: np.random.Generator) -> list[Effect]:
        """See `Stand.imperfection`; the tracker's noise included."""
        noise = wheeled_cases.tracker(rng)[0]
        self.pose_sd = pose_sd([noise])
        return [*imperfection(rng), *wheeled_cases.imperfection(rng), noise]

    def record(
        self, told: Sequence[Commands], effects: Sequence[Effect], seed: int
    ) -> tuple[Trial, ...]:
        """See `Stand.record`; what it is told is its own."""
        del told
        return record(seed, effects, singles=self.singles)

    def problem(self, plain: Sequence[Trial]) -> Problem:
        """See `Stand.problem`."""
        if self.wheels:
            self.model = self.motion
            return Problem.of(unhandled(plain, self.motion), self.motion)
        sight = SightModel(plain, pose_sd=self.pose_sd)
        self.model = sight
        return Problem.of(sight.ready(plain)[0], sight)


class Wanderer:
    """A policy: towards or past the light, with a turn that changes at random.

    Args:
        rng: of the robots' habits.
        count: robots.
    """

    def __init__(self, rng: np.random.Generator, count: int):
        self.speed = rng.uniform(0.03, 0.1, (count, 1))
        self.turning = rng.uniform(-0.06, 0.06, (count, 1))
        held = rng.integers(4, 12)
        wander = rng.uniform(-0.05, 0.05, (count, CYCLES // held + 1))
        self.wander = np.repeat(wander, held, axis=1)

    def memory(self, n: int) -> np.ndarray:
        """How many commands each has given."""
        return np.zeros((n, 1))

    def act(
        self, readings: np.ndarray, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """Wheel speeds from the virtual sensors, ``(n, 2)`` [m/s]."""
        at = int(memory[0, 0])
        turn = self.turning[:, 0] * (readings[:, 1] - readings[:, 0]) / 4095
        turn = turn + self.wander[:, at]
        told = self.speed + turn[:, None] * np.array([-1.0, 1.0])
        return np.clip(told, -0.14, 0.14), memory + 1


def imperfection(rng: np.random.Generator) -> list[Effect]:
    """How real sensors and lamps depart from the nominal ones; assumed."""
    made = [registry.make("light_dimmed", factor=float(rng.normal(1, 0.01)))]
    for sensor in SINGLE:
        bent, lost = float(rng.normal(0, 0.01)), abs(float(rng.normal(0, 0.01)))
        made.append(registry.make("sensor_misaligned", sensor=sensor, angle=bent))
        made.append(registry.make("sensor_dead", sensor=sensor, loss=lost))
    return made


def pose_sd(effects: Sequence[Effect]) -> tuple[float, float, float]:
    """Noise of the tracker among some effects [m, m, rad]."""
    noise = next(effect for effect in effects if effect.name == "tracker_noise")
    return (noise["position_sd"], noise["position_sd"], noise["heading_sd"])


def record(seed: int, effects: Sequence[Effect], *, singles: bool) -> tuple[Trial, ...]:
    """Drive the robots; the same habits and starts for the same seed.

    Args:
        seed: of habits, starts and the world.
        effects: what robot, light and tracker depart by, in any order.
        singles: as of `LightWorld`.
    """
    order = {"command": 0, "actuator": 1, "body": 2, "sensor": 3, "tracking": 4}
    world = LightWorld(
        singles=singles,
        supervisor={"at_lamp": "turn"},
        reality=sorted(effects, key=lambda effect: order[effect.stage]),
        name="real",
    )
    policy = Wanderer(seeding.generator(seed, "light case", "habits"), TRIALS)
    seeds = [seeding.integer(seed, "light case", n) for n in range(TRIALS)]
    trials = world.drive(policy, cycles=CYCLES, seeds=seeds)
    return tuple(trial.replace(conditions={}) for trial in trials)
