"""Recovery from raised legs with a sliding window of 300 patterns."""

from bench import hexapod_runs, solving
from bench.hexapod_gait import spread
from bench.result import Result

DOC = "worst median of trials until a damaged hexapod walks 90 % as far as before"
BAR = "median <= 30 trials for types 0, 1, 3 and <= 46 for types 2, 5; window 300"
MILD, LIMIT_MILD, LIMIT = ("type0", "type1", "type3"), 30, 46


def run(quick: bool) -> Result:
    """30 runs of each type, damage from trial 100 of 200; quick: one of 12 trials."""
    configs = {legs: hexapod_runs.damaged(legs) for legs in hexapod_runs.TYPES}
    records = hexapod_runs.records(configs.values(), quick=quick)
    found: dict[str, object] = {}
    medians, holds = [], True
    for legs, config in configs.items():
        record = records[config.preset]
        waits = solving.waits(hexapod_runs.trials_to_regain(record))
        onset = int(record.damage_onset[0])
        ways = record["distance"]
        found[legs] = {
            **waits,
            "before [m]": spread(ways[:, :onset][:, -hexapod_runs.BEFORE :].mean(1)),
            "first damaged trial [m]": spread(ways[:, onset]),
            "last ten trials [m]": spread(ways[:, -10:].mean(1)),
        }
        median = waits["median"]
        limit = LIMIT_MILD if legs in MILD else LIMIT
        holds = holds and median is not None and median <= limit
        medians.append(10.0 * record.trials if median is None else median)
    return Result(
        figure=max(medians),
        unit="trials",
        holds=None if quick else holds,
        n=record.replicates,
        details=found,
    )
