"""Forgetting by evidence in navigation, beside the sliding window of `recover-window`.

Nobody is told of the damage on either side. What a run forgets before there is any is
forgotten wrongly; what it should forget are the trials before the damage.
"""

from dataclasses import replace

import numpy as np

from bench.learning import experiments, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig
from bns.experiment.config_watch import WatchConfig
from bns.experiment.record import RunRecord

LIMIT = 70  # trials, as in `recover-window`
SOON = 2  # trials from the damage on


@bench(
    "cost after damage (O) in navigation, evidence over window 150, worst of four",
    bar="none: printed beside recover-window",
)
def forget_navigation(quick: bool) -> Result:
    """30 runs a side of each damage (from trial 30 of 100); quick: few and short."""
    sides = {
        damage: (_forgetting(damage), experiments.damaged(damage, window=150))
        for damage in experiments.DAMAGES
    }
    wanted = [config for pair in sides.values() for config in pair]
    records = experiments.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    for damage, pair in sides.items():
        evidence, window = (records[config.preset] for config in pair)
        costs = (stats.observation_after(record) for record in (evidence, window))
        found[damage] = {
            **solving.ratio(*costs),
            **solving.versus(evidence, window),
            "evidence": _recovery(evidence) | _forgotten(evidence),
            "window 150": _recovery(window),
        }
    return Result(
        figure=max(row["ratio"] for row in found.values()),
        unit="x",
        holds=None,
        n=evidence.replicates,
        details=found,
    )


def _forgetting(damage: str) -> RunConfig:
    config = experiments.damaged(damage, window=0)
    config = replace(config, watch=WatchConfig(forget=True))
    return experiments.named(config, f"{config.preset}-forget=True")


def _recovery(record: RunRecord) -> dict[str, object]:
    waits = solving.waits(stats.trials_to_recover(record))
    within = solving.recovered_within(record, LIMIT)
    return {f"recovered within {LIMIT}": within, **waits}


def _forgotten(record: RunRecord) -> dict[str, object]:
    """When trials were forgotten, by runs."""
    onset, gone = int(record.damage_onset[0]), record["forgotten"]
    before, after = gone[:, :onset], gone[:, onset:]
    soon, late = after[:, :SOON], after[:, SOON:]
    return {
        "runs that forgot before the damage": int(before.any(1).sum()),
        "trials they forgot": int(before.sum()),
        f"runs that forgot within {SOON} trials of it": int(soon.any(1).sum()),
        "trials they forgot then (median)": float(np.median(soon.sum(1))),
        "runs that forgot later": int(late.any(1).sum()),
        "trials they forgot later": int(late.sum()),
    }
