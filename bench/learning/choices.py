"""What the settings decide that the dissertation leaves silent: one changed at a time.

Run in the static-SNN world, which costs no physics: the simple problem, left wheel
50 % slower (the hardest of the four damages) from trial 12, window 150.
"""

import os
from dataclasses import replace

from bench.learning import experiments, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig

ONSET, TRIALS, RUNS = 12, 40, 8

VARIANTS: dict[str, tuple[str, object]] = {
    "defaults": ("preset", "defaults"),
    "printed fitness (rest not charged)": ("task.charge_unused", False),
    "squared distances": ("task.squared", True),
    "command cost 0.5 cm": ("task.command_cost", 0.5),
    "start heading 90 deg": ("task.start_yaw", 90.0),
    "no stops (lowest speed 8000)": ("controller.speed_low", 8000.0),
    "speeds from 0": ("controller.speed_low", 0.0),
    "lists up to 24": ("controller.max_commands", 24),
    "fixed length": ("controller.fixed_length", True),
    "world controller by tournament 0.1": ("choose", "tournament"),
    "20 generations a trial": ("evolution.generations", 20),
    "120 generations a trial": ("evolution.generations", 120),
    "no headless chicken": ("evolution.headless_chicken", 0.0),
    "no elitism": ("evolution.elitism", 0),
    "two-point crossover": ("evolution.crossover", "n-point"),
    "tournament of 2": ("evolution.tournament", 2),
    "100 epochs": ("snn.epochs", 100),
    "fresh SNN each trial": ("snn.warm_start", False),
    "no weight decay": ("snn.weight_decay", 0.0),
    "weight decay 0.01": ("snn.weight_decay", 0.01),
}


@bench(
    "sweep of the dissertation's silent settings: variants that beat the defaults",
    bar="none: the table behind docs/choices.md",
)
def choices(quick: bool) -> Result:
    """8 runs of 40 trials a variant; quick: 3 variants, 2 runs of 6 trials."""
    names = list(VARIANTS)[:3] if quick else list(VARIANTS)
    with experiments.pool_of_workers() as pool:
        rows = list(pool.map(_row, names, [quick] * len(names)))
    found = dict(zip(names, rows, strict=True))
    base = found["defaults"]["recovered"]["came"]
    better = sum(row["recovered"]["came"] > base for row in rows)
    return Result(
        figure=better, unit="variants", holds=None, n=len(names), details=found
    )


def _row(name: str, quick: bool) -> dict[str, dict[str, object]]:
    os.environ["OMP_NUM_THREADS"] = "1"
    from bns.experiment.run import train

    record = train(_config(name, quick))
    return {
        "solved": solving.waits(_before(stats.trials_to_solve(record), ONSET)),
        "recovered": solving.waits(stats.trials_to_recover(record)),
    }


def _before(waits, onset: int):
    """Waits that ended before the damage; the others count as never."""
    waits = waits.copy()
    waits[waits > onset] = float("inf")
    return waits


def _config(name: str, quick: bool) -> RunConfig:
    from bns import presets

    config = presets.load("khepera-simple")
    onset = 3 if quick else ONSET
    damage = (f"wheel_gain:wheel=left,factor=0.5@{onset}",)
    config = replace(
        config,
        world=replace(config.world, name="static-snn", damage=damage),
        trials=6 if quick else TRIALS,
        replicates=2 if quick else RUNS,
        threads=1,
        compiled="no",
        seed=20261121,
    )
    path, value = VARIANTS[name]
    if "." not in path:
        return replace(config, **{path: value})
    part, field = path.split(".")
    changed = replace(getattr(config, part), **{field: value})
    return replace(config, **{part: changed})
