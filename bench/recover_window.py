"""Recovery from four wheel damages with a sliding window of 150 patterns.

Every run that recovers shows that the encoding leaves the damage solvable. Beside it
stands the ceiling (`python -m bench ceiling`), where it has been run: what evolution
*directly in the damaged world*, without any SNN, reaches.
"""

from bench import ceiling, experiments, solving
from bench.result import Result, bench
from bns import stats

LIMIT, FEWEST, MEDIAN = 70, 27, 16


@bench(
    "fewest runs (over four damages) that recover within 70 trials, window 150",
    bar=">= 27 of 30 in each; median <= 16 trials for 20 %; all four solvable at all",
)
def recover_window(quick: bool) -> Result:
    """30 runs of each damage (from trial 30 of 100); quick: few and short."""
    configs = {d: experiments.damaged(d, window=150) for d in experiments.DAMAGES}
    records = experiments.records(configs.values(), quick=quick)
    found: dict[str, dict[str, object]] = {}
    holds = True
    for damage, config in configs.items():
        record = records[config.preset]
        waits = solving.waits(stats.trials_to_recover(record))
        within = solving.recovered_within(record, LIMIT)
        found[damage] = {"recovered within 70": within, **waits}
        quickly = waits["median"] is not None and waits["median"] <= MEDIAN
        holds = holds and within >= FEWEST and (quickly or damage.endswith("50"))
        found[damage]["ceiling"] = ceiling.known(damage) or "not run"
    return Result(
        figure=min(int(row["recovered within 70"]) for row in found.values()),
        unit="runs",
        holds=None if quick else holds,
        n=record.replicates,
        details=found,
    )
