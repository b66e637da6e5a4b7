"""What claims cost: all of them planned, and the rates of the plan measured.

The rates are processor times of a trial of a run in the claims, by learner.

A batch of ten on one thread, as `bns claims run` makes them. Trials before evolution
starts give what world and training take, those after it what evolution takes, and a
late trial of navigation without a window what its patterns take. Compiled code is used
where the claims use it; the time to compile is left out.
"""

import time
from dataclasses import asdict, replace

import numpy as np

from bench.result import Result, bench
from bns.claims import runner, schedule
from bns.claims.claim import INVESTIGATIONS, claims, member_of
from bns.experiment.config import RunConfig

MOST = 80


@bench(
    "processor hours planned for all claims in MuJoCo, trials shared, "
    "looks as expected",
    bar="<= 80 h",
)
def claims_plan(quick: bool) -> Result:
    """The plan of `bns claims plan`, in both worlds; the rates are `claims-price`'s."""
    del quick
    every = list(claims().values())
    details: dict[str, object] = {}
    for world in ("mujoco", "static-snn"):
        for letter in INVESTIGATIONS:
            part = [claim for claim in every if claim.investigation == letter]
            details[f"{letter} in {world}"] = asdict(
                schedule.planned(part, world=world)
            )
        details[f"without such a world: {world}"] = list(
            runner.impossible(every, world=world)
        )
    whole = schedule.planned(every, world="mujoco")
    return Result(
        figure=whole.hours,
        unit="h",
        holds=whole.hours <= MOST,
        n=whole.runs,
        details=details,
    )


RUNS = 10
CASES = {
    "navigation": ("A", "left-20"),
    "light": ("B", "plain"),
    "walk": ("D", "type-0"),
}
SOON, LATE = 8, {"navigation": 60}


@bench(
    "seconds of a processor for one trial of one run of the dearest learner",
    bar="none: bns/claims/data/price.toml is to have these rates",
)
def claims_price(quick: bool) -> Result:
    """Three learners; quick: navigation alone, and for a few trials."""
    found = {
        name: rates(name, trials=6 if quick else LATE.get(name, 2 * SOON))
        for name in (["navigation"] if quick else CASES)
    }
    return Result(
        figure=max(row["a trial"] for row in found.values()),
        unit="s",
        holds=None,
        n=RUNS,
        details={"measured": found, "price.toml": schedule.rates()},
    )


def rates(name: str, *, trials: int) -> dict[str, float]:
    """The rates of a learner, each of one run [s]."""
    letter, side = CASES[name]
    whole = member_of(letter, side, world="mujoco").config
    config = replace(whole, trials=trials, replicates=RUNS)
    config = replace(config, world=replace(config.world, damage=()))
    idle = np.median(_times(replace(config, trials=4), whole, evolved=False)[1:])
    times = _times(config, whole, evolved=True)
    first = max(config.evolve_from, 1) + 3  # one more may compile
    soon = np.median(times[first : first + SOON])
    late = np.median(times[-SOON:])
    evolution = config.evolution
    work = evolution.population * evolution.generations
    per_trial = schedule.rates()[name]["patterns"] * (trials - SOON - first)
    grown = (late - soon) / per_trial if per_trial > 0 else 0.0
    return {
        "a trial": float(soon / RUNS),
        "trial": float(idle / RUNS),
        "evolution": float(max(0.0, soon - idle) / RUNS / work),
        "pattern": float(max(0.0, grown) / RUNS),
    }


def _times(config: RunConfig, whole: RunConfig, *, evolved: bool) -> np.ndarray:
    """Processor time of each trial of a batch [s]."""
    from bns.experiment.batch import resolve
    from bns.experiment.run import train_many

    mode = resolve(replace(whole, replicates=RUNS))[1]
    config = replace(config, compiled="yes" if mode == "compiled" else "no")
    if not evolved:
        config = replace(config, evolve_from=config.trials)
    marks = [time.process_time()]
    train_many([config], on_trial=lambda *_: marks.append(time.process_time()))
    return np.diff(marks)
