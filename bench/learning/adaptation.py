"""Adaptation to damage that nobody tells: detected, and forgotten by evidence.

Detection is that of light following, with the adaptations that it triggers. Counted are
runs whose damage costs at least 20 % fitness: mean cost of the onset trial and the next
one over that of the same run's unharmed twin, which has the same starts and, in the
onset trial, the same controller. Costs vary threefold with the start alone, so that
over the five trials before, which is said as well, chance counts too. False alarms are
those of the unharmed twins, all trials before the damage among them.

Detected and told when damaged are compared with one seed on both sides, and what a
reset draws moves no draw of other runs: a run whose only alarm is in the trial of the
damage is the same to the byte on both sides. What is compared is what is found late,
never or falsely.

Forgetting by evidence stands beside sliding windows of light following and navigation.
In navigation nobody is told of the damage on either side. What a run forgets before
there is any is forgotten wrongly; what it should forget are the trials before the
damage.
"""

from dataclasses import replace

import numpy as np

from bench.learning import experiments, light, trunks
from bench.result import Result, bench
from bns import stats
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.learners.bns.config import WatchConfig

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
    records = trunks.forked([twin, *configs.values()], quick=quick)
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
    records = trunks.forked(wanted, quick=quick)
    found: dict[str, dict[str, object]] = {}
    worst = 0.0
    for damage, pair in sides.items():
        one, other = (records[config.preset] for config in pair.values())
        costs = stats.observation_after(one), stats.observation_after(other)
        ratio = experiments.ratio(*costs)
        worst = max(worst, ratio["ratio"])
        found[damage] = {
            **ratio,
            "the same runs": int(np.equal(*costs).sum()),
            **experiments.versus(one, other),
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


WINDOWS = (0, 150, 300, 600)
DRAWS = 4000  # of runs, to tell what chance alone does


@bench(
    "cost after damage (O), evidence over the best window, worst of nine damages",
    bar="<= 1.05 on every damage",
)
def forget_by_evidence(quick: bool) -> Result:
    """`RUNS` a side of each damage, light following; nobody is told."""
    sides = {damage: _sides(damage) for damage in light.ALL}
    wanted = [config for side in sides.values() for config in side.values()]
    records = trunks.forked(wanted, quick=quick)
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
        ratio = experiments.ratio(evidence, costs[best])
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
            **experiments.ratio(*costs),
            **experiments.versus(evidence, window),
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
    waits = experiments.waits(stats.trials_to_recover(record))
    within = experiments.recovered_within(record, RECOVERED)
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
