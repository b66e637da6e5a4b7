"""Damage detection in light following: hits, names, and false alarms.

Counted are runs whose damage costs at least 20 % fitness (mean cost of the onset trial
and the next one over that of the five trials before).
"""

import numpy as np

from bench import experiments, light_runs
from bench.result import Result
from bns.record import RunRecord

DOC = "share of costly damages detected within 2 trials, and false alarms"
BAR = ">= 95 % detected, <= 1 false alarm per 500 undamaged trials"
SHARE, ALARMS, COSTLY = 0.95, 1.0, 1.2
WATCH = {"detect": True}


def run(quick: bool) -> Result:
    """30 runs of each of nine damages, from trial 20 of 40, nobody told."""
    configs = {
        damage: light_runs.damaged(
            damage, watch=WATCH, ensemble=True, population_reset=False
        )
        for damage in light_runs.ALL
    }
    records = experiments.records(configs.values(), quick=quick)
    found = {
        damage: _row(records[config.preset], light_runs.AFFECTED[damage])
        for damage, config in configs.items()
    }
    costly = sum(row["costly runs"] for row in found.values())
    hits = sum(row["of them detected"] for row in found.values())
    alarms = sum(row["false alarms"] for row in found.values())
    trials = sum(row["undamaged trials"] for row in found.values())
    share, rate = hits / max(costly, 1), 500 * alarms / max(trials, 1)
    return Result(
        figure=share,
        unit="of costly damages",
        holds=None if quick else share >= SHARE and rate <= ALARMS,
        n=costly,
        details={"false alarms per 500 trials": round(rate, 3), **found},
    )


def _row(record: RunRecord, affected: tuple[str, ...]) -> dict[str, int]:
    from bns.light.watching import CHANNELS

    onset = int(record.damage_onset[0])
    cost, alarm = record["fitness"], record["detected"] > 0
    before = cost[:, onset - 5 : onset].mean(1)
    costly = cost[:, onset : onset + 2].mean(1) >= COSTLY * before
    near = alarm[:, onset : onset + 2]
    suspect = record["suspect"][:, onset : onset + 2]
    named = [
        bool(runs.any()) and CHANNELS[int(names[runs.argmax()])] in affected
        for runs, names in zip(near, suspect, strict=True)
    ]
    return {
        "costly runs": int(costly.sum()),
        "of them detected": int((near.any(1) & costly).sum()),
        "of them named rightly": int((np.array(named) & costly).sum()),
        "detected of all": int(near.any(1).sum()),
        "false alarms": int(alarm[:, :onset].sum()),
        "undamaged trials": int(alarm[:, :onset].size),
    }
