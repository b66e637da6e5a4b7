"""Forgetting by evidence against the best sliding window for each damage."""

import numpy as np

from bench.learning import forking, light_runs, solving
from bench.result import Result, bench
from bns import stats

LIMIT = 1.05
WINDOWS = (0, 150, 300, 600)
RUNS = 30  # a side
DRAWS = 4000  # of runs, to tell what chance alone does


@bench(
    "cost after damage (O), evidence over the best window, worst of nine damages",
    bar="<= 1.05 on every damage",
)
def forget_by_evidence(quick: bool) -> Result:
    """`RUNS` a side of each damage, light following; nobody is told."""
    sides = {damage: _sides(damage) for damage in light_runs.ALL}
    wanted = [config for side in sides.values() for config in side.values()]
    records = forking.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst, chance = 0.0, np.zeros(DRAWS)
    for damage, configs in sides.items():
        costs = {
            name: stats.observation_after(records[config.preset])
            for name, config in configs.items()
        }
        medians = {name: float(np.median(cost)) for name, cost in costs.items()}
        evidence = costs.pop("evidence")  # what stays are the windows
        best = min(costs, key=medians.get)
        ratio = solving.ratio(evidence, costs[best])
        worst = max(worst, ratio["ratio"])
        equal = _of_equals(costs, best)
        chance = np.maximum(chance, equal)
        found[damage] = {
            **ratio,
            "best window": best,
            **medians,
            "above by chance, if as good": round(float(np.mean(equal > LIMIT)), 3),
        }
    return Result(
        figure=worst,
        unit="x",
        holds=None if quick else worst <= LIMIT,
        n=records[wanted[0].preset].replicates,
        details={
            **found,
            "all within, if as good": round(float(np.mean(chance <= LIMIT)), 3),
        },
    )


def _of_equals(windows: dict[str, np.ndarray], best: str) -> np.ndarray:
    """Ratios of a rule whose costs are those of the best window, in drawn runs.

    Args:
        windows: costs with each window, ``(R,)``.
        best: the one with the least median.

    Returns:
        ``(DRAWS,)``: median of R drawn runs over the least median of R drawn runs of
        each window.
    """
    rng = np.random.default_rng(0)

    def medians(costs: np.ndarray) -> np.ndarray:
        return np.median(rng.choice(costs, (DRAWS, len(costs))), axis=1)

    least = np.min([medians(costs) for costs in windows.values()], axis=0)
    return medians(windows[best]) / least


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
