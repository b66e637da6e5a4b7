"""What a run of the walking learner costs, and where the time goes."""

import time
from dataclasses import replace

from bench.result import Result, bench
from bench.walking import runs
from bns.experiment.config import RunConfig

LIMIT = 10.0
TRIALS, BATCH, SOME = 200, 6, 10


@bench(
    "processor time of one hexapod run of 200 trials, window 300",
    bar="<= 10 min on 2 cores",
)
def hexapod_run_cost(quick: bool) -> Result:
    """The preset, one run of 200 trials on two threads; quick: 12 small trials.

    Processor time, because it is the same on a busy machine: on a quiet one the run
    takes no longer than that. Beside it what a trial of a run costs alone and in a
    batch of six, over the first ten trials.
    """
    config = runs.damaged("1,5")
    config = replace(config, trials=TRIALS, replicates=1, threads=2)
    if quick:
        config = runs.small(config)
    whole = measure(config)
    details: dict[str, object] = {"one run": whole}
    if not quick:
        some = replace(config, trials=SOME, world=replace(config.world, damage=()))
        alone, many = measure(some), measure(replace(some, replicates=BATCH))
        details[f"one run, {SOME} trials"] = alone
        details[f"{BATCH} runs, {SOME} trials"] = many
        details["share of a run's cost in a batch"] = round(
            many["processor [s]"] / BATCH / alone["processor [s]"], 3
        )
    minutes = whole["processor [s]"] / 60
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=None if quick else minutes <= LIMIT,
        n=config.trials,
        details=details,
    )


def measure(config: RunConfig) -> dict[str, float]:
    """Seconds of evolution, world and training, start-up included in the total."""
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world

    begun, wall = time.process_time(), time.perf_counter()
    config, mode = resolve(config)
    batch = Batch([config], [make_world(config)])
    learner, kind = batch.learner, {"evolution": 0.0, "world": 0.0, "training": 0.0}
    for trial in range(config.trials):
        marks = [time.process_time()]
        proposal = learner.propose(trial)
        marks.append(time.process_time())
        seen = batch._execute(proposal.tried, trial, "world")
        marks.append(time.process_time())
        learner.observe(trial, seen, None)
        marks.append(time.process_time())
        for name, a, b in zip(kind, marks, marks[1:], strict=False):
            kind[name] += b - a
    return {
        **{f"{name} [s]": round(seconds, 2) for name, seconds in kind.items()},
        "processor [s]": round(time.process_time() - begun, 2),
        "wall [s]": round(time.perf_counter() - wall, 2),
        "compiled": mode == "compiled",
    }
