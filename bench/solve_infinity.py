"""Trials until the undamaged Khepera III solves the infinity problem."""

from bench import experiments, solving
from bench.result import Result, bench
from bns import stats


@bench(
    "runs that solve the infinity problem within 60 trials, undamaged",
    bar=">= 24 of 30 runs within 60 trials",
)
def solve_infinity(quick: bool) -> Result:
    """30 runs of the preset `khepera-infinity`, 60 trials each."""
    config = experiments.undamaged("infinity")
    record = experiments.records([config], quick=quick)[config.preset]
    within = solving.solved_within(record, 60)
    return Result(
        figure=within,
        unit="runs",
        holds=None if quick else within >= 24,
        n=record.replicates,
        details=solving.waits(stats.trials_to_solve(record)),
    )
