"""Forgetting by evidence against the best sliding window for each damage."""

import numpy as np

from bench import experiments, forking, light_runs
from bench.result import Result
from bns import stats

DOC = "cost after damage (O), evidence over the best window, worst of nine damages"
BAR = "<= 1.05 on every damage"
LIMIT = 1.05
WINDOWS = (0, 150, 300, 600)
RUNS = 6  # a side; 30 are the full bench, which then judges the bar


def run(quick: bool) -> Result:
    """`RUNS` a side of each damage, light following; nobody is told."""
    sides = {damage: _sides(damage) for damage in light_runs.ALL}
    wanted = [config for side in sides.values() for config in side.values()]
    records = forking.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, configs in sides.items():
        cost = {
            name: float(np.median(stats.observation_after(records[config.preset])))
            for name, config in configs.items()
        }
        evidence = cost.pop("evidence")
        best = min(cost, key=cost.get)
        ratio = evidence / cost[best]
        worst = max(worst, ratio)
        found[damage] = {
            "ratio": round(ratio, 4),
            "best window": best,
            "evidence": evidence,
            **cost,
        }
    few = quick or RUNS < experiments.REPLICATES
    return Result(
        figure=worst,
        unit="x",
        holds=None if few else worst <= LIMIT,
        n=records[wanted[0].preset].replicates,
        details=found,
    )


def _sides(damage: str):
    windows = {
        f"window {size}" if size else "none": light_runs.damaged(
            damage, runs=RUNS, window=size, population_reset=False
        )
        for size in WINDOWS
    }
    evidence = light_runs.damaged(
        damage, watch={"forget": True}, runs=RUNS, window=0, population_reset=False
    )
    return {"evidence": evidence, **windows}
