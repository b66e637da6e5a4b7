"""Adaptations triggered by what was detected, against told when damaged."""

from bench import detect_damage, experiments, forking, light_runs, solving
from bench.result import Result

DOC = "cost after damage (O), detected over told, worst of four damages"
BAR = "<= 1.05"
LIMIT = 1.05
RUNS = 6  # a side; 30 are the full bench, which then judges the bar
AFTER = 10  # trials from the damage on; 20 are the full bench


def run(quick: bool) -> Result:
    """Four damages (table 6.7), detected as in `detect-damage` and told.

    What is triggered is the population reset.
    """
    sides = {
        damage: {
            "detected": detect_damage.watched(damage, after=AFTER, runs=RUNS),
            "told": light_runs.damaged(damage, ensemble=True, runs=RUNS, after=AFTER),
        }
        for damage in light_runs.DAMAGES
    }
    wanted = [config for pair in sides.values() for config in pair.values()]
    records = forking.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, pair in sides.items():
        one, other = (records[config.preset] for config in pair.values())
        compared = solving.versus(one, other)
        ratio = compared["medians"][0] / compared["medians"][1]
        worst = max(worst, ratio)
        found[damage] = {"ratio of medians": round(ratio, 4), **compared}
    few = quick or RUNS < experiments.REPLICATES
    return Result(
        figure=worst,
        unit="x",
        holds=None if few else worst <= LIMIT,
        n=one.replicates,
        details=found,
    )
