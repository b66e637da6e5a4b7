"""Trials until the undamaged Khepera III solves the simple problem."""

from bench import experiments, solving
from bench.result import Result, bench
from bns import stats


@bench(
    "median trials to solve the simple problem, undamaged",
    bar="median <= 12 trials, >= 28 of 30 runs within 30",
)
def solve_simple(quick: bool) -> Result:
    """30 runs of the preset `khepera-simple` without damage, 30 trials each."""
    config = experiments.undamaged("simple")
    record = experiments.records([config], quick=quick)[config.preset]
    waits = solving.waits(stats.trials_to_solve(record))
    median = waits["median"]
    within = solving.solved_within(record, 30)
    return Result(
        figure=median if median is not None else float(record.trials + 1),
        unit="trials",
        holds=None if quick else median is not None and median <= 12 and within >= 28,
        n=record.replicates,
        details={"solved within 30": within, **waits},
    )
