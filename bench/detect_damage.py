"""Damage detection in light following: hits, names, and false alarms.

Counted are runs whose damage costs at least 20 % fitness (mean cost of the onset trial
and the next one over that of the five trials before).
"""

import numpy as np

from bench import experiments, forking, light_runs
from bench.result import Result
from bns.config import RunConfig
from bns.record import RunRecord

DOC = "share of costly damages detected within 2 trials, and false alarms"
BAR = ">= 95 % detected, <= 1 false alarm per 500 undamaged trials"
SHARE, ALARMS, COSTLY = 0.95, 1.0, 1.2
RUNS = 6  # of each damage; 30 are the full bench, which then judges the bar
AFTER = 4  # trials from the damage on


def run(quick: bool) -> Result:
    """`RUNS` of each of nine damages, from trial 20 on, nobody told (table 6.7)."""
    configs = {damage: watched(damage) for damage in light_runs.ALL}
    records = forking.records(configs.values(), quick=quick)
    found = {
        damage: _row(records[config.preset], light_runs.AFFECTED[damage])
        for damage, config in configs.items()
    }
    costly = sum(row["costly runs"] for row in found.values())
    hits = sum(row["of them detected"] for row in found.values())
    alarms = sum(row["false alarms"] for row in found.values())
    trials = sum(row["undamaged trials"] for row in found.values())
    few = quick or RUNS < experiments.REPLICATES
    share, rate = hits / max(costly, 1), 500 * alarms / max(trials, 1)
    return Result(
        figure=share,
        unit="of costly damages",
        holds=None if few else share >= SHARE and rate <= ALARMS,
        n=costly,
        details={"false alarms per 500 trials": round(rate, 3), **found},
    )


def watched(damage: str, after: int = AFTER) -> RunConfig:
    """The side of a damage whose adaptations follow what is detected."""
    return light_runs.damaged(
        damage, watch={"detect": True}, ensemble=True, runs=RUNS, after=after
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
