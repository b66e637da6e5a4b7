"""Deployed controllers of BNS: do they solve after damage, and do those tried?"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bench.learning import experiments, light
from bench.result import Result, bench
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord

LIMIT = 0.90
LAST = 10  # trials
RUNS = 10  # of each damage


@bench(
    "share of the last ten trials that deployed controllers solve after damage, worst",
    bar=">= 0.90 on each of four damages; tried beside it",
)
def deployed_navigate(quick: bool) -> Result:
    """`RUNS` of each damage from trial 30 of 100, window 150; quick: few and short."""
    wanted = {
        damage: _named(experiments.damaged(damage, window=150), damage)
        for damage in experiments.DAMAGES
    }
    return _result(wanted, quick=quick)


@bench(
    "the same in light following, whose trials begin anywhere on the board",
    bar=">= 0.90 on each of four damages; tried beside it",
)
def deployed_light(quick: bool) -> Result:
    """`khepera-light-recover`, `RUNS` of each damage from trial 20 of 70."""
    wanted = {
        damage: _named(
            replace(light.recovering(damage), trials=light.ONSET + 50),
            f"light-{damage}",
        )
        for damage in light.DAMAGES
    }
    return _result(wanted, quick=quick)


def _named(config: RunConfig, name: str) -> RunConfig:
    """The configuration that deploys what was seen to work, with a seed of its own."""
    named = experiments.named(config, f"deployed-{name}")
    return replace(named, deploy="seen", replicates=RUNS)


def _result(configs: Mapping[str, RunConfig], *, quick: bool) -> Result:
    """The worst damage's share of trials that the deployed controllers solve."""
    records = experiments.records(configs.values(), quick=quick)
    found = {damage: row(records[c.preset]) for damage, c in configs.items()}
    worst = min(each["deployed"] for each in found.values())
    return Result(
        figure=worst,
        unit="1",
        holds=None if quick else worst >= LIMIT,
        n=min(records[c.preset].replicates for c in configs.values()),
        details=found,
    )


def row(record: RunRecord) -> dict[str, float]:
    """Shares of the last trials that solved the task, over all runs."""
    onset = int(record.damage_onset[0])
    deployed, tried = record["solved_best"], record["solved"]
    new = np.where(record["retried"] > 0, np.nan, tried)[:, -LAST:]
    shares = {
        "deployed": deployed[:, -LAST:].mean(),
        "tried": tried[:, -LAST:].mean(),
        "tried anew": np.nanmean(new),
        "deployed, runs with all ten": (deployed[:, -LAST:] > 0).all(1).mean(),
        "deployed, ten before the damage": deployed[:, onset - LAST : onset].mean(),
        "tried, ten before the damage": tried[:, onset - LAST : onset].mean(),
        "trials that tried one again": record["retried"].mean(),
    }
    return {name: round(float(share), 4) for name, share in shares.items()}
