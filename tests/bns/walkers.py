"""A walking robot that is quick and needs no MuJoCo, and a learner small enough."""

from dataclasses import replace

import numpy as np

from bns import presets
from bns.worlds.damage import Damage
from bns.worlds.trial import Trial

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
