"""Recovery in light following: a slow wheel and three sensor damages (table 6.7).

The sensor at its minimum once more with settings of our own, which judge no bar.
"""

from bench import experiments, forking, light_runs, solving
from bench.result import Result
from bns import stats
from bns.record import RunRecord

DOC = "most trials to recover (median, over four damages) in light following, T6.7"
BAR = "slow wheel / noisy / minimum / maximum sensor: median <= 12 / 10 / 12 / 10"
MEDIANS = {"slow-wheel": 12, "noisy": 10, "minimum": 12, "maximum": 10}
RUNS = 10  # of each damage; 30 are the full bench, which then judges the bar
OURS = {"readings": "balanced", "charge_stopped": "far"}
THESIS = {"slow-wheel": 10, "noisy": 4, "minimum": "8 and 9", "maximum": 7}


def run(quick: bool) -> Result:
    """`RUNS` of each damage, from trial 20 of 40."""
    configs = {
        damage: light_runs.damaged(damage, runs=RUNS) for damage in light_runs.DAMAGES
    }
    ours = light_runs.damaged("minimum", light=OURS, runs=RUNS)
    records = forking.records([*configs.values(), ours], quick=quick)
    found: dict[str, dict[str, object]] = {}
    holds, worst = True, 0.0
    for damage, config in configs.items():
        record = records[config.preset]
        row = _row(record)
        median = row["median"]
        holds = holds and median is not None and median <= MEDIANS[damage]
        worst = max(worst, record.trials + 1.0 if median is None else median)
        found[damage] = {
            "bar": MEDIANS[damage],
            "one run on the robot (6.5)": THESIS[damage],
            **row,
        }
    found["minimum, settings of our own"] = OURS | _row(records[ours.preset])
    few = quick or RUNS < experiments.REPLICATES
    return Result(
        figure=worst,
        unit="trials",
        holds=None if few else holds,
        n=record.replicates,
        details=found,
    )


def _row(record: RunRecord) -> dict[str, object]:
    onset, solved = int(record.damage_onset[0]), record["solved"]
    return {
        "solved trials, five before the damage": _share(solved[:, onset - 5 : onset]),
        "solved in the onset trial": _share(solved[:, onset]),
        "solved trials, last five": _share(solved[:, -5:]),
        **solving.waits(stats.trials_to_recover(record)),
    }


def _share(solved) -> float:
    return round(float(solved.mean()), 3)
