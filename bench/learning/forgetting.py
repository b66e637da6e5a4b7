"""Forgetting by evidence, beside sliding windows of light following and navigation.

In navigation nobody is told of the damage on either side. What a run forgets before
there is any is forgotten wrongly; what it should forget are the trials before the
damage.
"""

from dataclasses import replace

import numpy as np

from bench.learning import experiments, forking, light, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.learners.bns.config import WatchConfig

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
    sides = {damage: _sides(damage) for damage in light.ALL}
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
        f"window {size}" if size else "none": light.damaged(
            damage, runs=RUNS, window=size, population_reset=False
        )
        for size in WINDOWS
    }
    evidence = light.damaged(
        damage, watch={"forget": True}, runs=RUNS, window=0, population_reset=False
    )
    return {"evidence": evidence, **windows}


RECOVERED = 70  # trials, as in `recover-window`
SOON = 2  # trials from the damage on


@bench(
    "cost after damage (O) in navigation, evidence over window 150, worst of four",
    bar="none: printed beside recover-window",
)
def forget_navigation(quick: bool) -> Result:
    """30 runs a side of each damage (from trial 30 of 100); quick: few and short."""
    sides = {
        damage: (_forgetting(damage), experiments.damaged(damage, window=150))
        for damage in experiments.DAMAGES
    }
    wanted = [config for pair in sides.values() for config in pair]
    records = experiments.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    for damage, pair in sides.items():
        evidence, window = (records[config.preset] for config in pair)
        costs = (stats.observation_after(record) for record in (evidence, window))
        found[damage] = {
            **solving.ratio(*costs),
            **solving.versus(evidence, window),
            "evidence": _recovery(evidence) | _forgotten(evidence),
            "window 150": _recovery(window),
        }
    return Result(
        figure=max(row["ratio"] for row in found.values()),
        unit="x",
        holds=None,
        n=evidence.replicates,
        details=found,
    )


def _forgetting(damage: str) -> RunConfig:
    config = experiments.damaged(damage, window=0)
    config = replace(config, watch=WatchConfig(forget=True))
    return experiments.named(config, f"{config.preset}-forget=True")


def _recovery(record: RunRecord) -> dict[str, object]:
    waits = solving.waits(stats.trials_to_recover(record))
    within = solving.recovered_within(record, RECOVERED)
    return {f"recovered within {RECOVERED}": within, **waits}


def _forgotten(record: RunRecord) -> dict[str, object]:
    """When trials were forgotten, by runs."""
    onset, gone = int(record.damage_onset[0]), record["forgotten"]
    before, after = gone[:, :onset], gone[:, onset:]
    soon, late = after[:, :SOON], after[:, SOON:]
    return {
        "runs that forgot before the damage": int(before.any(1).sum()),
        "trials they forgot": int(before.sum()),
        f"runs that forgot within {SOON} trials of it": int(soon.any(1).sum()),
        "trials they forgot then (median)": float(np.median(soon.sum(1))),
        "runs that forgot later": int(late.any(1).sum()),
        "trials they forgot later": int(late.sum()),
    }
