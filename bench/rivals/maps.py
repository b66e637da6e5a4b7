"""Deployed controllers of BNS after damage; rivals with a repertoire, IT&E and RTE.

IT&E is as the original's tests had it: Mailer, Nitschke and Raw (2021). Compared are
numbers of tests, not speeds: walking that rests after each command is no gait of 1 Hz,
and how far a map's gaits get is a matter of the evaluations spent on it. RTE is
compared with the same planner without the process that corrects its behaviours.
"""

from collections.abc import Mapping
from dataclasses import replace

import numpy as np

from bench.learning import experiments, light
from bench.result import Result, bench
from bench.rivals import batches
from bns import presets
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord

LIMIT = 0.90
LAST = 10  # trials
RUNS = 10  # of each damage


@bench(
    "share of the last ten trials that deployed controllers solve after damage, worst",
    bar=">= 0.90 on each of four damages; tried beside it",
)
def deployed_navigate(quick: bool) -> Result:
    """`RUNS` of each damage from trial 30 of 100, window 150; quick: few and short."""
    wanted = {
        damage: _named(experiments.damaged(damage, window=150), damage)
        for damage in experiments.DAMAGES
    }
    return _result(wanted, quick=quick)


@bench(
    "the same in light following, whose trials begin anywhere on the board",
    bar=">= 0.90 on each of four damages; tried beside it",
)
def deployed_light(quick: bool) -> Result:
    """`khepera-light-recover`, `RUNS` of each damage from trial 20 of 70."""
    wanted = {
        damage: _named(
            replace(light.recovering(damage), trials=light.ONSET + 50),
            f"light-{damage}",
        )
        for damage in light.DAMAGES
    }
    return _result(wanted, quick=quick)


def _named(config: RunConfig, name: str) -> RunConfig:
    """The configuration that deploys what was seen to work, with a seed of its own."""
    named = experiments.named(config, f"deployed-{name}")
    return replace(named, deploy="seen", replicates=RUNS)


def _result(configs: Mapping[str, RunConfig], *, quick: bool) -> Result:
    """The worst damage's share of trials that the deployed controllers solve."""
    records = experiments.records(configs.values(), quick=quick)
    found = {damage: row(records[c.preset]) for damage, c in configs.items()}
    worst = min(each["deployed"] for each in found.values())
    return Result(
        figure=worst,
        unit="1",
        holds=None if quick else worst >= LIMIT,
        n=min(records[c.preset].replicates for c in configs.values()),
        details=found,
    )


def row(record: RunRecord) -> dict[str, float]:
    """Shares of the last trials that solved the task, over all runs."""
    onset = int(record.damage_onset[0])
    deployed, tried = record["solved_best"], record["solved"]
    new = np.where(record["retried"] > 0, np.nan, tried)[:, -LAST:]
    shares = {
        "deployed": deployed[:, -LAST:].mean(),
        "tried": tried[:, -LAST:].mean(),
        "tried anew": np.nanmean(new),
        "deployed, runs with all ten": (deployed[:, -LAST:] > 0).all(1).mean(),
        "deployed, ten before the damage": deployed[:, onset - LAST : onset].mean(),
        "tried, ten before the damage": tried[:, onset - LAST : onset].mean(),
        "trials that tried one again": record["retried"].mean(),
    }
    return {name: round(float(share), 4) for name, share in shares.items()}


DAMAGES = {
    "intact": {"none": ""},
    "one leg": {"1": "1", "3": "3", "5": "5"},
    "opposite": {"1,4": "1,4", "2,3": "2,3", "5,6": "5,6"},
    "next but one": {"1,3": "1,3", "1,6": "1,6", "3,6": "3,6"},
    "neighbours": {"1,2": "1,2", "1,5": "1,5", "3,5": "3,5", "3,4": "3,4"},
}
"""legs by number: 1, 5, 3, 4, 6, 2 around the body"""
MOST = 20  # tests, as in Cully et al. 2015
PUBLISHED = {
    "intact": "1",
    "one leg": "2 (1-4)",
    "opposite": "3 (1-5)",
    "next but one": "8 (1-21)",
    "neighbours": "24 (12-38)",
}
"""median tests (5 to 95 %) on a map of 20,000 cells and 40 M evaluations"""


@bench(
    "tests of IT&E until it keeps a gait: intact, one leg, pairs of legs raised",
    bar="intact 1; one leg <= 4; opposite, next but one <= 12; neighbours >= 2 x one",
)
def faithful_ite(quick: bool) -> Result:
    """One recovery a damage on the map that ships; quick: intact and one leg."""
    from bns.prior import repertoire

    groups = list(DAMAGES)[: 2 if quick else None]
    found = {name: _group(DAMAGES[name]) for name in groups}
    tests = {name: float(np.median(row["tests"])) for name, row in found.items()}
    head = repertoire.read("phantomx-1").head
    details: dict[str, object] = {
        name: {**row, "median": tests[name], "published": PUBLISHED[name]}
        for name, row in found.items()
    }
    details["evaluations of the map"] = head.evaluations
    return Result(
        figure=max(tests.values()),
        unit="tests",
        holds=None if quick else holds(tests),
        n=sum(len(DAMAGES[name]) for name in groups),
        details=details,
    )


def holds(tests: dict[str, float]) -> bool:
    """Whether medians of tests are as published."""
    return (
        tests["intact"] == 1
        and tests["one leg"] <= 4
        and max(tests["opposite"], tests["next but one"]) <= 12
        and tests["neighbours"] >= 2 * tests["one leg"]
    )


def _group(damages: dict[str, str]) -> dict[str, list[float]]:
    """Tests and distances of some damages, one recovery each, as one batch."""
    from bns.experiment.batch import Batch
    from bns.experiment.loading import with_learner
    from bns.experiment.world_factory import make_world

    base = replace(presets.load("hexapod-walk"), replicates=1, threads=1)
    base = with_learner(base, "ite").with_({"prior.repertoire": "phantomx-1"})
    configs = [
        replace(base, world=replace(base.world, damage=_texts(legs)))
        for legs in damages.values()
    ]
    batch = Batch(configs, [make_world(config) for config in configs])
    rows = []
    for trial in range(MOST + 2):
        rows.append(batch.advance(trial)[0].columns)
        if trial > 1 and all(tests.done for tests in batch.learner.tests):
            break
    return {
        "tests": rows[-1]["tests"].tolist(),
        "kept [m]": (np.sqrt(-rows[-1]["fitness_best"]) / 100).round(3).tolist(),
        "at once [m]": rows[1]["worth_seen"].round(3).tolist(),
    }


def _texts(legs: str) -> tuple[str, ...]:
    return (f"leg_raised:legs={legs},blend=1@1",) if legs else ()


LEAST_LOST, MOST_LOST, BEST = 0.20, 0.30, 20


@bench(
    "loss of the best walks of the repertoire in the world of the prior P2",
    bar="0.20 to 0.30 (median of the best twenty)",
)
def prior_off(quick: bool) -> Result:
    """The best of the map in both worlds; quick: five of them."""
    from bns.prior import mismatch, repertoire
    from bns.tasks import registry as tasks
    from bns.worlds import registry as worlds

    found = repertoire.read("phantomx-1")
    task = tasks.of(replace(presets.load("hexapod-walk"), threads=1))
    rows = np.argsort(-found.worth)[: 5 if quick else BEST]
    tried = found.space(task).controllers(found.vectors(task)[rows])
    told = {"robot": "phantomx", "threads": 1}
    gap = mismatch.reality("phantomx")
    exact, off = (
        task.worth(worlds.make("hexapod", **told, reality=reality).run(tried))
        for reality in ((), gap)
    )
    loss = float(1 - np.median(off / exact))
    return Result(
        figure=round(loss, 4),
        unit="1",
        holds=None if quick else LEAST_LOST <= loss <= MOST_LOST,
        n=len(rows),
        details={
            "in the nominal world [m]": exact.round(3).tolist(),
            "with the gap [m]": off.round(3).tolist(),
            "gap": list(gap),
            "evaluations of the map": found.head.evaluations,
        },
    )


WHEELS = {
    f"{side}-{lost}": f"wheel_gain:wheel={side},factor={1 - lost / 100:g}"
    for side in ("left", "right")
    for lost in (20, 50)
}
ONSET, AFTER = 1, 10  # trials
LEARNED = 10  # of each damage


@bench(
    "trials that RTE needs to solve navigation after damage, worst of four wheels",
    bar="fewer than the same planner without the process, on each damage",
)
def faithful_rte(quick: bool) -> Result:
    """`LEARNED` of each, P1, at most `AFTER` trials; quick: two of one damage, six."""
    names = list(WHEELS)[: 1 if quick else None]
    runs, after = (2, 6) if quick else (LEARNED, AFTER)
    found = {
        name: {
            kind: trials_to_solve(WHEELS[name], learning, runs, after)
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
    told = {
        "prior.world": "mujoco",
        "settings.learning": learning,
        "world.damage": [f"{damage}@{ONSET}"],
    }
    seen = batches.columns("rte", runs=runs, trials=ONSET + after, **told)
    solved = seen["solved"][:, ONSET:]
    ever = solved.any(axis=1)
    first: list[int] = np.where(ever, solved.argmax(axis=1) + 1, after + 1).tolist()
    return first
