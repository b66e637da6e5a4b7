"""Forgetting by evidence against the best sliding window for each damage."""

import numpy as np

from bench import forking, light_runs, solving
from bench.result import Result
from bns import stats

DOC = "cost after damage (O), evidence over the best window, worst of nine damages"
BAR = "<= 1.05 on every damage"
LIMIT = 1.05
WINDOWS = (0, 150, 300, 600)
RUNS = 30  # a side


def run(quick: bool) -> Result:
    """`RUNS` a side of each damage, light following; nobody is told."""
    sides = {damage: _sides(damage) for damage in light_runs.ALL}
    wanted = [config for side in sides.values() for config in side.values()]
    records = forking.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, configs in sides.items():
        costs = {
            name: stats.observation_after(records[config.preset])
            for name, config in configs.items()
        }
        medians = {name: float(np.median(cost)) for name, cost in costs.items()}
        best = min((n for n in medians if n != "evidence"), key=medians.get)
        ratio = solving.ratio(costs["evidence"], costs[best])
        worst = max(worst, ratio["ratio"])
        found[damage] = {**ratio, "best window": best, **medians}
    return Result(
        figure=worst,
        unit="x",
        holds=None if quick else worst <= LIMIT,
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
