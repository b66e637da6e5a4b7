"""A wheel that stops now and then: a noise-aware SNN against a plain one (claim C5)."""

import numpy as np

from bench.learning import forking, light_runs, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.record import RunRecord

SPAN = 10
RUNS = 30  # a side


@bench(
    "cost of the last ten trials over the first ten with an intermittent wheel",
    bar="noise-aware: no decline (<= 1.0); the plain one beside it",
)
def intermittent_wheel(quick: bool) -> Result:
    """`RUNS` a side, every fifth command lost from trial 20 of 40, no adaptation."""
    sides = {
        name: light_runs.damaged(
            "wheel-intermittent",
            light={"noise": noise},
            runs=RUNS,
            window=0,
            population_reset=False,
        )
        for name, noise in (("noise-aware", 1.0), ("plain", 0.0))
    }
    records = forking.records(sides.values(), quick=quick)
    aware, plain = (records[config.preset] for config in sides.values())
    declines = {"noise-aware": _decline(aware), "plain": _decline(plain)}
    middle = float(np.median(declines["noise-aware"]))
    return Result(
        figure=middle,
        unit="x",
        holds=None if quick else middle <= 1.0,
        n=aware.replicates,
        details={
            "plain": float(np.median(declines["plain"])),
            "p of the two declines": stats.mann_whitney(*declines.values()),
            "noise-aware against plain (O)": solving.versus(aware, plain),
        },
    )


def _decline(record: RunRecord) -> np.ndarray:
    """Cost of the last trials over that of the first damaged ones, ``(R,)``."""
    onset = int(record.damage_onset[0])
    span = min(SPAN, (record.trials - onset) // 2)
    cost = record["fitness_best"]
    return cost[:, -span:].mean(1) / cost[:, onset : onset + span].mean(1)
