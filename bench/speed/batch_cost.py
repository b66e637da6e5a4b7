"""What a run costs in a batch of thirty beside a run alone."""

import time
from dataclasses import replace
from statistics import median
from typing import Any

from bench.result import Result, bench

LIMIT = 0.4
THREADS = 2
BATCH = 30


@bench("learner time per run: 30 in a batch against 1 alone, per trial", bar="<= 0.4 x")
def batch_cost(quick: bool) -> Result:
    """The same preset as a batch of 1 and of 30, both compiled, trials interleaved."""
    trials, warm = (6, 3) if quick else (25, 5)
    sizes = (1, BATCH) if quick else (1, 3, 10, BATCH)
    runs = {size: _batch(size) for size in sizes}
    seconds: dict[int, list[float]] = {size: [] for size in sizes}
    for trial in range(trials):
        for size, (batch, world) in runs.items():
            seconds[size].append(_trial(batch, world, trial) / size)
    cost = {size: values[warm:] for size, values in seconds.items()}
    pairs = zip(cost[BATCH], cost[1], strict=True)
    ratio = median(many / alone for many, alone in pairs)
    return Result(
        figure=round(ratio, 4),
        unit="x",
        holds=ratio <= LIMIT,
        n=trials - warm,
        details={
            f"ms per run and trial, batch of {size}": round(1e3 * median(values), 2)
            for size, values in cost.items()
        },
    )


def _batch(size: int) -> tuple[Any, Any]:
    from bns import presets
    from bns.experiment.batch import Batch, resolve
    from bns.experiment.world_factory import make_world

    config = presets.load("khepera-simple")
    config = replace(config, replicates=size, threads=THREADS, compiled="yes")
    config, _ = resolve(config)
    world = make_world(config)
    return Batch([config], [world]), world


def _trial(batch: Any, world: Any, trial: int) -> float:
    """Seconds the learner takes for one trial; the world's are left out."""
    begin = time.perf_counter()
    tried = batch.learner.propose(trial).tried
    proposed = time.perf_counter()
    seen = world.run(tried, trial=trial)
    ran = time.perf_counter()
    batch.learner.observe(trial, seen, None)
    return proposed - begin + time.perf_counter() - ran
