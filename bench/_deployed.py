"""What benches of deployed controllers print: solved as deployed and as tried."""

from collections.abc import Mapping, Sequence

import numpy as np

from bench.result import Result
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord

BAR = 0.90
LAST = 10  # trials


def result(
    configs: Mapping[str, RunConfig], records: Mapping[str, RunRecord], *, quick: bool
) -> Result:
    """The worst damage's share of runs whose deployed controller solves.

    Args:
        configs: of the damages.
        records: by names of configurations.
        quick: whether the runs were cut short, and no bar can be judged.
    """
    found = {damage: row(records[c.preset]) for damage, c in configs.items()}
    worst = min(float(each["deployed"]) for each in found.values())
    runs: Sequence[int] = [records[c.preset].replicates for c in configs.values()]
    return Result(
        figure=worst,
        unit="1",
        holds=None if quick else worst >= BAR,
        n=min(runs),
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
