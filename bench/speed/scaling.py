"""Time and memory of training against the number of runs and of cores."""

import json
import os
import resource
import sys
import time
from dataclasses import replace
from itertools import pairwise
from statistics import median

from bench.processes import finish
from bench.result import Result, bench

RUNS, THREADS = (1, 3, 10, 30), (1, 2)
TRIALS, WARM = 12, 4


@bench(
    "seconds per trial and peak memory against runs in a batch and threads",
    bar="none: printed",
)
def scaling(quick: bool) -> Result:
    """Every case in a process of its own; quick: one thread, 1 and 3 runs, eager."""
    cases = [(runs, threads) for threads in THREADS for runs in RUNS]
    cases = [(1, 1), (3, 1)] if quick else cases
    found = {
        f"{r} runs, {t} threads": _apart(r, t, "no" if quick else "yes")
        for r, t in cases
    }
    last = found[f"{cases[-1][0]} runs, {cases[-1][1]} threads"]
    return Result(
        figure=last["peak memory [MiB]"],
        unit="MiB",
        holds=None,
        n=len(cases),
        details=found,
    )


def _apart(runs: int, threads: int, compiled: str) -> dict[str, float]:
    done = finish(
        [
            sys.executable,
            "-m",
            "bench.speed.scaling",
            str(runs),
            str(threads),
            compiled,
        ],
        limit=600.0,
        environment={"OMP_NUM_THREADS": str(threads)},
    )
    return json.loads(done.output.strip().splitlines()[-1])


def case(runs: int, threads: int, compiled: str) -> dict[str, float]:
    """Train a little with one batch, in this process.

    Args:
        runs: replicates in the batch.
        threads: of the learner and of the physics.
        compiled: "yes" or "no".

    Returns:
        median seconds of a trial once it is warm, per trial and per run, and the
        process's peak memory.
    """
    from bns import presets
    from bns.experiment.run import train

    config = replace(
        presets.load("khepera-simple"),
        replicates=runs,
        threads=threads,
        trials=TRIALS,
        compiled=compiled,
    )
    marks = [time.perf_counter()]
    train(config, on_trial=lambda *_: marks.append(time.perf_counter()))
    lasting = [b - a for a, b in pairwise(marks)][WARM:]
    peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1024
    return {
        "trial [s]": round(median(lasting), 3),
        "trial and run [s]": round(median(lasting) / runs, 4),
        "peak memory [MiB]": round(peak),
    }


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", sys.argv[2])
    print(json.dumps(case(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])))
