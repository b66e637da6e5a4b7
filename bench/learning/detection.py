"""Damage detection in light following, and adaptations that it triggers.

Counted are runs whose damage costs at least 20 % fitness: mean cost of the onset trial
and the next one over that of the same run's unharmed twin, which has the same starts
and, in the onset trial, the same controller. Costs vary threefold with the start alone,
so that over the five trials before, which is said as well, chance counts too. False
alarms are those of the unharmed twins, all trials before the damage among them.

Detected and told when damaged are compared with one seed on both sides, and what a
reset draws moves no draw of other runs: a run whose only alarm is in the trial of the
damage is the same to the byte on both sides. What is compared is what is found late,
never or falsely.
"""

from dataclasses import replace

import numpy as np

from bench.learning import forking, light, solving
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord

SHARE, ALARMS, COSTLY = 0.95, 1.0, 1.2
RUNS = 30  # of each damage
AFTER = 2  # trials from the damage on
OVER_BEFORE = ("costly over the trials before", "of those detected")


@bench(
    "share of costly damages detected within 2 trials, and false alarms",
    bar=">= 95 % detected, <= 1 false alarm per 500 undamaged trials",
)
def detect_damage(quick: bool) -> Result:
    """`RUNS` of each of nine damages, from trial 20 on, nobody told (table 6.7)."""
    configs = {damage: watched(damage) for damage in light.ALL}
    twin = watched("unharmed")
    records = forking.records([twin, *configs.values()], quick=quick)
    whole, quiet = (records[twin.preset][name] for name in ("fitness", "detected"))
    found = {
        damage: _row(records[config.preset], light.AFFECTED[damage], whole)
        for damage, config in configs.items()
    }
    costly = sum(row["costly runs"] for row in found.values())
    hits = sum(row["of them detected"] for row in found.values())
    alarms, trials = int((quiet > 0).sum()), quiet.size
    before = [sum(row[name] for row in found.values()) for name in OVER_BEFORE]
    share, rate = hits / max(costly, 1), 500 * alarms / trials
    return Result(
        figure=share,
        unit="of costly damages",
        holds=None if quick else share >= SHARE and rate <= ALARMS,
        n=costly,
        details={
            "false alarms per 500 trials": round(rate, 3),
            "false alarms": alarms,
            "undamaged trials": trials,
            **dict(zip(OVER_BEFORE, before, strict=True)),
            **found,
        },
    )


def watched(damage: str, *, after: int = AFTER, runs: int = RUNS) -> RunConfig:
    """The side of a damage whose adaptations follow what is detected."""
    return light.damaged(
        damage, watch={"detect": True}, ensemble=True, runs=runs, after=after
    )


def _row(
    record: RunRecord, affected: tuple[str, ...], whole: np.ndarray
) -> dict[str, int]:
    """Counts of one damage; `whole` are the costs of the unharmed twins."""
    from bns.learners.bns.light.simulator import CHANNELS

    onset = int(record.damage_onset[0])
    cost, alarm = record["fitness"], record["detected"] > 0
    both = slice(onset, onset + 2)
    costly = cost[:, both].mean(1) >= COSTLY * whole[:, both].mean(1)
    before = cost[:, onset - 5 : onset].mean(1)
    over = cost[:, both].mean(1) >= COSTLY * before
    near = alarm[:, both]
    suspect = record["suspect"][:, both]
    named = [
        bool(runs.any()) and CHANNELS[int(names[runs.argmax()])] in affected
        for runs, names in zip(near, suspect, strict=True)
    ]
    return {
        "costly runs": int(costly.sum()),
        "of them detected": int((near.any(1) & costly).sum()),
        "of them named rightly": int((np.array(named) & costly).sum()),
        OVER_BEFORE[0]: int(over.sum()),
        OVER_BEFORE[1]: int((near.any(1) & over).sum()),
        "detected of all": int(near.any(1).sum()),
    }


LIMIT = 1.05
LATER = 20  # trials from the damage on


@bench(
    "cost after damage (O), detected over told, worst of four damages", bar="<= 1.05"
)
def detection_triggered(quick: bool) -> Result:
    """Four damages (table 6.7), detected as in `detect-damage` and told.

    What is triggered is the population reset.
    """
    sides = {
        damage: {
            "detected": watched(damage, after=LATER, runs=RUNS),
            "told": _told(damage),
        }
        for damage in light.DAMAGES
    }
    wanted = [config for pair in sides.values() for config in pair.values()]
    records = forking.records(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, pair in sides.items():
        one, other = (records[config.preset] for config in pair.values())
        costs = stats.observation_after(one), stats.observation_after(other)
        ratio = solving.ratio(*costs)
        worst = max(worst, ratio["ratio"])
        found[damage] = {
            **ratio,
            "the same runs": int(np.equal(*costs).sum()),
            **solving.versus(one, other),
        }
    return Result(
        figure=worst,
        unit="x",
        holds=None if quick else worst <= LIMIT,
        n=one.replicates,
        details=found,
    )


def _told(damage: str) -> RunConfig:
    """The side that knows, with the seed of the one that detects."""
    detecting = watched(damage, after=LATER, runs=RUNS)
    config = light.damaged(damage, ensemble=True, runs=RUNS, after=LATER)
    return replace(config, seed=detecting.seed)
