"""A walking robot that is quick and needs no MuJoCo, and a learner small enough."""

from dataclasses import replace

import numpy as np

from bns import presets
from bns.worlds.trial import Trial

STRIDE = 0.05
"""[m/rad] the body moves forward by so much per radian that the coxae go back"""


class Slider:
    """Each command moves the body ahead by what the six coxae go back on average."""

    name, robot = "slider", "phantomx"

    def run(self, commands, *, trial=0, seeds=()):
        return [self._one(item) for item in commands]

    def _one(self, commands):
        coxae = np.vstack([np.zeros(6), commands.values[:, ::3]])
        steps = -STRIDE * np.abs(np.diff(coxae, axis=0)).mean(axis=1)
        poses = np.zeros((len(commands) + 1, 3))
        poses[1:, 0] = np.cumsum(steps)
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
