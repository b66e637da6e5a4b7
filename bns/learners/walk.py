"""Walking: eleven commands of servo goals that carry the robot far."""

from collections.abc import Sequence
from typing import Any

from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.worlds.trial import Commands, Trial
from bns.worlds.world import World

DOC = "lists of servo goals that carry a legged robot as far as can be (D)"
DEARNESS = 0.0
"""what compiling a generation saves: nothing, see `bns.walk.loops`"""


def make(
    configs: Sequence[RunConfig], *, replicates: Sequence[int], onsets: Sequence[int]
) -> Any:
    """The learner of a batch, see `bns.walk.learner.WalkLearner`."""
    from bns.walk.learner import WalkLearner

    if configs[0].watch.detect:
        raise BnsError(
            "watch.detect is for navigation and light following; leave it out. "
            "watch.forget is for walking, too."
        )
    return WalkLearner(configs, replicates=replicates, onsets=onsets)


def execute(
    world: World, tried: Sequence[Commands], *, trial: int, seeds: Sequence[int]
) -> list[Trial]:
    """Each list of commands on a robot of its own, from the start pose."""
    return world.run(tried, trial=trial, seeds=seeds)


def surroundings(config: RunConfig) -> dict[str, Any]:
    """Nothing: the robot starts in the middle of the board, at rest."""
    del config
    return {}
