"""Adaptations triggered by what was detected, against told when damaged.

Both sides have one seed, and what a reset draws moves no draw of other runs: a run
whose only alarm is in the trial of the damage is the same to the byte on both sides.
What is compared is what is found late, never or falsely.
"""

from dataclasses import replace

import numpy as np

from bench.learning import detect_damage, forking, light_runs, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig

LIMIT = 1.05
RUNS = 30  # a side
AFTER = 20  # trials from the damage on


@bench(
    "cost after damage (O), detected over told, worst of four damages", bar="<= 1.05"
)
def detection_triggered(quick: bool) -> Result:
    """Four damages (table 6.7), detected as in `detect-damage` and told.

    What is triggered is the population reset.
    """
    sides = {
        damage: {
            "detected": detect_damage.watched(damage, after=AFTER, runs=RUNS),
            "told": _told(damage),
        }
        for damage in light_runs.DAMAGES
    }
    wanted = [config for pair in sides.values() for config in pair.values()]
    records = forking.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, pair in sides.items():
        one, other = (records[config.preset] for config in pair.values())
        costs = stats.observation_after(one), stats.observation_after(other)
        ratio = solving.ratio(*costs)
        worst = max(worst, ratio["ratio"])
        found[damage] = {
            **ratio,
            "the same runs": int(np.equal(*costs).sum()),
            **solving.versus(one, other),
        }
    return Result(
        figure=worst,
        unit="x",
        holds=None if quick else worst <= LIMIT,
        n=one.replicates,
        details=found,
    )


def _told(damage: str) -> RunConfig:
    """The side that knows, with the seed of the one that detects."""
    detecting = detect_damage.watched(damage, after=AFTER, runs=RUNS)
    config = light_runs.damaged(damage, ensemble=True, runs=RUNS, after=AFTER)
    return replace(config, seed=detecting.seed)
