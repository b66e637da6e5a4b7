"""Robots that are quick and need no MuJoCo, and learners small enough for them.

One walks; one is a point on two wheels that sees light.
"""

from dataclasses import replace

import numpy as np

from bns import presets, seeding
from bns.worlds import registry
from bns.worlds.damage import Damage
from bns.worlds.light.sensors import VIRTUAL
from bns.worlds.trial import POSE_CHANNELS, Commands, Trial

STRIDE = 0.05
"""[m/rad] the body moves forward by so much per radian that the coxae go back"""

SIDES = np.array([3.0, -3.0, 2.0, -2.0, 1.0, -1.0])


class Slider:
    """Each command moves the body ahead by what the six coxae go back on average.

    Legs that are held up do not push, and the body turns to their side.
    """

    name, robot = "slider", "phantomx"

    def __init__(self, damages=(), **told):
        self.damages = damages

    def having(self, damages):
        return Slider(damages)

    def run(self, commands, *, trial=0, seeds=()):
        damages = self.damages or [Damage.none()] * len(commands)
        return [self._one(*both) for both in zip(commands, damages, strict=True)]

    def _one(self, commands, damage):
        push = np.ones(6)
        for effect in (event.effect for event in damage.events):
            for leg in str(effect["legs"]).split(","):
                push[int(leg) - 1] -= effect["blend"]
        coxae = np.vstack([np.zeros(6), commands.values[:, ::3]])
        ways = np.abs(np.diff(coxae, axis=0)) * push
        steps = -STRIDE * ways.mean(axis=1)
        poses = np.zeros((len(commands) + 1, 3))
        poses[1:, 0] = np.cumsum(steps)
        poses[1:, 1] = STRIDE * np.cumsum(ways @ ((1 - push) * SIDES))
        count = len(poses)
        return Trial(
            commands, np.arange(count), poses, np.arange(count), robot="phantomx"
        )


def small(**changes):
    """The preset, cut down to a second; `changes` are settings of the whole."""
    config = presets.load("hexapod-walk")
    config = replace(
        config,
        evolution=replace(config.evolution, population=40, generations=8, tournament=8),
        snn=replace(config.snn, members=3, hidden=32, epochs=60),
        trials=10,
        replicates=2,
        record_replicates=1,
        compiled="no",
        threads=1,
    )
    return replace(config, **changes)


AXLE = 0.0884


class FakeLightWorld:
    """Exact wheels, and light that falls with distance and with the angle."""

    name, robot = "fake-light", "khepera3"

    def __init__(self, damages=()):
        self.damages = damages

    def having(self, damages):
        return FakeLightWorld(damages)

    def run(self, commands, *, trial=0, seeds=()):
        raise NotImplementedError

    def drive(self, policy, *, cycles=100, cycle=0.4, trial=0, seeds=(), starts=None):
        poses = np.array([self.start(seed, trial) for seed in seeds])
        memory, gains = policy.memory(len(poses)), self.gains(len(poses))
        path, read, told = [poses], [self.look(poses)], []
        for _ in range(cycles):
            commands, memory = policy.act(read[-1], memory)
            poses = self.moved(poses, commands * gains * cycle)
            told.append(commands)
            path.append(poses)
            read.append(self.look(poses))
        seen = np.concatenate([np.stack(path, 1), np.stack(read, 1)], axis=-1)
        count = np.arange(cycles + 1)
        return [
            Trial(
                Commands(values, np.full(cycles, cycle)),
                count * cycle,
                rows,
                count,
                channels=POSE_CHANNELS + VIRTUAL,
                robot=self.robot,
                world=self.name,
            )
            for values, rows in zip(np.stack(told, 1), seen, strict=True)
        ]

    def gains(self, n):
        """Of the left and the right wheel of each robot, ``(n, 2)``."""
        found = np.ones((n, 2))
        for row, damage in zip(found, self.damages, strict=False):
            for effect in (event.effect for event in damage.events):
                row[["left", "right"].index(effect["wheel"])] *= effect["factor"]
        return found

    @staticmethod
    def start(seed, trial):
        rng = seeding.generator(seed, "fake", trial)
        angle, away = rng.uniform(-np.pi, np.pi), rng.uniform(0.5, 1.0)
        return away * np.cos(angle), away * np.sin(angle), rng.uniform(-np.pi, np.pi)

    @staticmethod
    def look(poses):
        bearing = np.arctan2(-poses[:, 1], -poses[:, 0]) - poses[:, 2]
        distance = np.hypot(poses[:, 0], poses[:, 1])
        sides = bearing[:, None] - np.radians([45, -45])
        light = np.maximum(np.cos(sides), 0) ** 2 / (1 + 4 * distance[:, None] ** 2)
        return np.rint(4095 * (1 - light))

    @staticmethod
    def moved(poses, ways):
        turn = (ways[:, 1] - ways[:, 0]) / AXLE
        forward, yaw = ways.mean(1), poses[:, 2] + turn / 2
        step = np.stack([forward * np.cos(yaw), forward * np.sin(yaw), turn], 1)
        return poses + step


def small_light(**light):
    """The preset cut down to a second; settings of the section `light`."""
    config = presets.load("khepera-light")
    return replace(
        config,
        evolution=replace(config.evolution, population=12, generations=2, tournament=3),
        snn=replace(config.snn, epochs=20, hidden=8),
        light=replace(config.light, starts=2, cycles=20, circle_cycles=8, **light),
        trials=3,
        replicates=2,
        record_replicates=1,
        compiled="no",
        threads=1,
    )


def wheels(damage=()):
    """The static-SNN world of the Khepera III, which starts in the centre."""
    return registry.make(
        "static-snn", robot="khepera3", damage=damage, start=(0.0, 0.0, 0.0)
    )
