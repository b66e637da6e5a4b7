"""Which runs of light following may share a batch."""

from collections.abc import Sequence
from dataclasses import replace

from bns.errors import BnsError
from bns.experiment.config import RunConfig

PER_RUN = ("mirror", "weights", "mutation_magnitude", "reset_every", "reset_elitists")
"""settings of `light` in which the runs of a batch may differ, as in the mutation rate
and the headless chicken of `evolution`, in `adaptation` and in `world`"""


def check(configs: Sequence[RunConfig]) -> None:
    """Refuse configurations that cannot share a batch, or cannot be at all.

    Raises:
        BnsError: they differ in what all runs share, or contradict themselves.
    """
    first = configs[0]
    same = {name: getattr(first.light, name) for name in PER_RUN}

    def core(config: RunConfig) -> RunConfig:
        """What all runs of a batch share; the rest as in the first."""
        return replace(
            config,
            preset=first.preset,
            adaptation=first.adaptation,
            world=first.world,
            light=replace(config.light, **same),
            evolution=replace(
                config.evolution,
                mutation_rate=first.evolution.mutation_rate,
                headless_chicken=first.evolution.headless_chicken,
            ),
        )

    if any(core(config) != core(first) for config in configs):
        raise BnsError(
            "Runs of one batch of light following may differ in `adaptation`, `world`, "
            f"{', '.join(f'`light.{name}`' for name in PER_RUN)}, "
            "`evolution.mutation_rate` and `evolution.headless_chicken` only; train "
            "the others as a batch of their own."
        )
    if first.evolution.population % first.light.islands:
        raise BnsError(
            f"evolution.population = {first.evolution.population} cannot be shared "
            f"alike by light.islands = {first.light.islands}; take a multiple."
        )
    if 0 < first.light.renewed >= first.light.islands:
        raise BnsError(
            f"light.renewed = {first.light.renewed} would start all of light.islands = "
            f"{first.light.islands} anew before each trial, and nothing would be "
            "learned: take fewer, or more islands."
        )
