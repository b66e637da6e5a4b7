"""Adaptations triggered by what was detected, against told when damaged."""

from bench import experiments, light_runs, solving
from bench.result import Result

DOC = "cost after damage (O), detected over told, worst of four damages"
BAR = "<= 1.05"
LIMIT = 1.05


def run(quick: bool) -> Result:
    """30 runs a side of each damage (table 6.7): the population reset is triggered."""
    sides = {
        damage: {
            "detected": light_runs.damaged(
                damage, watch={"detect": True}, ensemble=True
            ),
            "told": light_runs.damaged(damage, ensemble=True),
        }
        for damage in light_runs.DAMAGES
    }
    wanted = [config for pair in sides.values() for config in pair.values()]
    records = experiments.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, pair in sides.items():
        one, other = (records[config.preset] for config in pair.values())
        compared = solving.versus(one, other)
        ratio = compared["medians"][0] / compared["medians"][1]
        worst = max(worst, ratio)
        found[damage] = {"ratio of medians": round(ratio, 4), **compared}
    return Result(
        figure=worst,
        unit="x",
        holds=None if quick else worst <= LIMIT,
        n=one.replicates,
        details=found,
    )
