"""What campaigns cost beside their runs, and how they scale."""

import json
import os
import resource
import sys
import tempfile
import time
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median

from bench.processes import finish
from bench.result import Result, bench
from bench.storage.campaigns import tiny
from bns.campaign import drive
from bns.campaign.engines import registry
from bns.campaign.file import Campaign, from_content

LIMIT = 2.0
ENGINES = ("local", "ray")


@bench(
    "time per batch beside its computation, one worker, batches of demo size",
    bar="<= 2 % of the batch's time",
)
def engine_overhead(quick: bool) -> Result:
    """From the end of one batch to the end of the next, less what it computed.

    That holds giving out the job, the way back, storing with fsync, and the log. The
    first batch, in which the worker starts, is left out. Medians; the figure is the
    worse engine's.
    """
    batches = 4 if quick else 8
    details: dict[str, object] = {}
    worst = 0.0
    with tempfile.TemporaryDirectory() as name:
        for engine in ENGINES:
            found = _measure(engine, _demo(batches, quick), Path(name) / engine)
            details[f"{engine}, batches of demo size"] = found
            worst = max(worst, found["percent"])
            small = _measure(engine, tiny(2 * batches), Path(name) / f"{engine}-small")
            details[f"{engine}, tiny batches"] = small
    return Result(
        figure=round(worst, 3),
        unit="%",
        holds=None if quick else worst <= LIMIT,
        n=batches - 1,
        details=details,
    )


def _demo(batches: int, quick: bool) -> Campaign:
    """Six runs a batch with the demo's evolution and training."""
    settings = {
        "trials": 4 if quick else 6,
        "world": {"damage": ["wheel_gain:wheel=left,factor=0.8@2"]},
    }
    content = {
        "preset": "demo",
        "replicates": 6,
        "batch_runs": 6,
        "settings": settings,
        "grid": {"adaptation": {"window": list(range(100, 100 + batches))}},
    }
    return from_content(content, "demo")


def _measure(engine: str, campaign: Campaign, out: Path) -> dict[str, float]:
    session = drive.run(campaign, out, registry.make(engine, workers=1))
    if session.failed or session.missing:
        raise RuntimeError(f"{engine}: {session}")
    lines = [json.loads(line) for line in (out / "log.jsonl").read_text().splitlines()]
    entries = [entry for entry in lines if "batch" in entry]
    ends = [entry["at"] for entry in entries]
    computed = [entry["computed"] for entry in entries][1:]
    beside = [
        later - earlier - own
        for earlier, later, own in zip(ends, ends[1:], computed, strict=False)
    ]
    shares = [100 * b / c for b, c in zip(beside, computed, strict=True)]
    return {
        "percent": round(median(shares), 3),
        "milliseconds": round(1000 * median(beside), 2),
        "computed seconds": round(median(computed), 2),
    }


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
            "bench.speed.campaigns",
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
