"""Open-loop navigation: lists of wheel commands that reach objectives in order."""

from collections.abc import Sequence
from typing import Any

from bns.experiment.config import RunConfig
from bns.worlds.trial import Commands, Trial
from bns.worlds.world import World

DOC = "lists of wheel commands that reach objectives in order (investigation A)"


def make(
    configs: Sequence[RunConfig], *, replicates: Sequence[int], onsets: Sequence[int]
) -> Any:
    """The learner of a batch, see `bns.learner.Learner`; one that watches if asked."""
    from bns.learner import Learner
    from bns.watched import WatchedLearner

    watch = configs[0].watch
    kind = WatchedLearner if watch.detect or watch.forget else Learner
    return kind(configs, replicates=replicates, onsets=onsets)


def execute(
    world: World, tried: Sequence[Commands], *, trial: int, seeds: Sequence[int]
) -> list[Trial]:
    """Each list of commands on a robot of its own, from the start pose."""
    return world.run(tried, trial=trial, seeds=seeds)


def surroundings(config: RunConfig) -> dict[str, Any]:
    """Where the robot starts."""
    from bns.tasks import NavigationTask

    return {"start": NavigationTask.of(config.task).start}
