"""Closed-loop light following: networks that drive to a lamp and circle it."""

from collections.abc import Sequence
from typing import Any

from bns.experiment.config import RunConfig
from bns.worlds.trial import Trial

DOC = "networks from light readings to wheels that drive to a lamp and stay (B and C)"
DEARNESS = 80.0
"""cost of a generation, that of navigation being 1 (100 cycles, ten starts)"""


def make(
    configs: Sequence[RunConfig], *, replicates: Sequence[int], onsets: Sequence[int]
) -> Any:
    """The learner of a batch, see `bns.light.learner.LightLearner`."""
    from bns.light.learner import LightLearner

    return LightLearner(configs, replicates=replicates, onsets=onsets)


def execute(
    world: Any, tried: Sequence[Any], *, trial: int, seeds: Sequence[int]
) -> list[Trial]:
    """Each controller drives a robot of its own, from where the world starts it."""
    from bns.light.policy import GenomePolicy

    return world.drive(
        GenomePolicy.of(tried),
        cycles=tried[0].cycles,
        cycle=tried[0].cycle,
        trial=trial,
        seeds=seeds,
    )


def surroundings(config: RunConfig) -> dict[str, Any]:
    """The lamps, and who watches over the robots."""
    from bns.light.task import lamps

    light = config.light
    return {
        "lights": lamps(light),
        "ambient": light.ambient,
        "supervisor": {"safety": light.safety, "at_lamp": light.at_lamp},
    }
