"""A learner and a world that are quick and need neither torch nor MuJoCo.

Run as a program it trains them, killing itself at a chosen moment:

    python fakes.py DIRECTORY WRITE MOMENT

WRITE counts the files written; MOMENT is "before", "beside" (whole, but not in its
place) or "after".
"""

import os
import signal
import sys
from dataclasses import replace

import numpy as np

from bns import seeding
from bns.experiment import versions
from bns.experiment.config import RunConfig, WorldConfig
from bns.experiment.task_settings import ControllerConfig
from bns.learners import registry
from bns.learners.base import Learner, Proposal
from bns.storage import files
from bns.worlds.trial import Commands, Trial

CONFIG = RunConfig(
    preset="fake",
    learner="fake",
    controller=ControllerConfig(max_commands=4, initial_min=1, initial_max=4),
    world=WorldConfig(damage=("wheel_gain:wheel=left,factor=0.8@2",)),
    trials=4,
    replicates=3,
    record_replicates=2,
)


class FakeLearner(Learner):
    """Its memory is one number per run, moved by what it sees and by chance."""

    def __init__(self, configs, *, replicates, onsets, models=()):
        super().__init__(configs, replicates=replicates, onsets=onsets, models=models)
        self.onsets = list(onsets)
        self.memory = np.zeros(len(configs))

    @classmethod
    def compiles(cls, config):
        return config.compiled == "yes"

    def propose(self, trial):
        tried = []
        for run, replicate in enumerate(self.replicates):
            rng = seeding.generator(self.config.seed, "fake", replicate, trial)
            count = 1 + run % self.config.controller.max_commands
            values = rng.uniform(-0.1, 0.1, (count, 2)) + 1e-3 * self.memory[run]
            tried.append(Commands(values, np.full(count, 0.5)))
        return Proposal(tried)

    def observe(self, trial, tried, best):
        longest = self.config.controller.max_commands
        sent = np.full((len(tried), longest, 3), np.nan)
        poses = np.full((len(tried), longest + 1, 3), np.nan)
        for run, seen in enumerate(tried):
            sent[run, : len(seen.commands), :2] = seen.commands.values
            poses[run, : len(seen.commands) + 1] = seen.command_poses_world
        self.memory = 0.9 * self.memory + np.nansum(poses[..., 0], axis=1)
        solved = (self.memory > 0).astype(float)
        fitness = self.memory.copy()
        columns = {"fitness": fitness, "fitness_best": fitness, "solved": solved}
        kept = {"sent": sent, "poses": poses, "predicted": poses + 0.01}
        return columns | kept | {"felt": np.stack([self.memory, -self.memory], 1)}

    def state(self):
        return {"memory": self.memory}

    def restore(self, arrays):
        self.memory = arrays["memory"]


class FakeWorld:
    """The pose is the sum of what was sent, and a little noise."""

    name, robot = "fake", "khepera3"

    def run(self, commands, *, trial=0, seeds=()):
        return [
            self._one(item, trial, seed)
            for item, seed in zip(commands, seeds, strict=True)
        ]

    def _one(self, commands, trial, seed):
        rng = np.random.default_rng([seed, trial])
        steps = np.column_stack([commands.values, commands.durations])
        poses = np.vstack([np.zeros(3), steps]).cumsum(axis=0)
        poses += rng.normal(0, 1e-3, poses.shape)
        count = len(commands) + 1
        times = np.arange(count) * 0.5
        return Trial(
            commands, times, poses, np.arange(count), robot=self.robot, world=self.name
        )


registry.register("fake", FakeLearner)


def dies_at(write, moment):
    """Make the process kill itself around the file written as number `write`."""
    count, whole = 0, files.replace

    def die():
        os.kill(os.getpid(), signal.SIGKILL)

    def replacing(path, make):
        nonlocal count
        count += 1
        number = count  # a directory is one write around those of its files

        def making(temporary):
            make(temporary)
            if number == write and moment == "beside":
                die()

        if number == write and moment == "before":
            die()
        whole(path, making)
        if number == write and moment == "after":
            die()

    files.replace = replacing


def train(directory, **options):
    """Train the fakes in `directory`."""
    from bns.experiment.run import train

    config = options.pop("config", CONFIG)
    return train(config, directory, world=FakeWorld(), **options)


def longer(trials):
    """The fake configuration with another number of trials."""
    return replace(CONFIG, trials=trials)


if __name__ == "__main__":
    versions.commit = lambda: "test"
    dies_at(int(sys.argv[2]), sys.argv[3])
    train(sys.argv[1], resume=True)
