"""RTE against the same planner without the process that corrects its behaviours."""

from dataclasses import replace

import numpy as np

from bench.result import Result, bench
from bns import presets

DAMAGES = {
    f"{side}-{lost}": f"wheel_gain:wheel={side},factor={1 - lost / 100:g}"
    for side in ("left", "right")
    for lost in (20, 50)
}
ONSET, AFTER = 1, 10  # trials
RUNS = 10  # of each damage


@bench(
    "trials that RTE needs to solve navigation after damage, worst of four wheels",
    bar="fewer than the same planner without the process, on each damage",
)
def faithful_rte(quick: bool) -> Result:
    """`RUNS` of each, P1, at most `AFTER` trials; quick: two of one damage, six."""
    names = list(DAMAGES)[: 1 if quick else None]
    runs, after = (2, 6) if quick else (RUNS, AFTER)
    found = {
        name: {
            kind: trials_to_solve(DAMAGES[name], learning, runs, after)
            for kind, learning in (("with", True), ("without", False))
        }
        for name in names
    }
    medians = {
        name: {kind: float(np.median(trials)) for kind, trials in row.items()}
        for name, row in found.items()
    }
    return Result(
        figure=max(row["with"] for row in medians.values()),
        unit="trials",
        holds=all(row["with"] < row["without"] for row in medians.values()),
        n=runs * len(names),
        details={
            "trials, one more than the most = never": found,
            "medians": medians,
            "most": after,
        },
    )


def trials_to_solve(damage: str, learning: bool, runs: int, after: int) -> list[int]:
    """Trials from the damage on, the one that solves counted; `after` + 1 = none.

    Args:
        damage: effect as text.
        learning: whether behaviours are corrected.
        runs: replicates.
        after: trials from the damage on.
    """
    from bns.experiment.batch import Batch
    from bns.experiment.loading import with_learner
    from bns.experiment.world_factory import make_models, make_world

    base = replace(presets.load("khepera-simple"), replicates=runs, threads=1)
    config = with_learner(base, "rte").with_(
        {
            "prior.world": "mujoco",
            "settings.learning": learning,
            "world.damage": [f"{damage}@{ONSET}"],
        }
    )
    batch = Batch([config], [make_world(config)], models=make_models(config))
    solved = np.array(
        [batch.advance(trial)[0].columns["solved"] for trial in range(ONSET + after)]
    )[ONSET:]
    ever = solved.any(axis=0)
    first: list[int] = np.where(ever, solved.argmax(axis=0) + 1, after + 1).tolist()
    return first
