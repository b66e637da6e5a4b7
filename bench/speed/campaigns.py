"""What whole commands cost: campaigns beside their runs, the demonstration, the tests.

Campaigns also as they scale.
"""

import json
import os
import resource
import subprocess
import sys
import tempfile
import time
from collections import Counter
from dataclasses import replace
from itertools import pairwise
from pathlib import Path
from statistics import median
from tempfile import TemporaryDirectory

from bench.processes import finish
from bench.result import Result, bench
from bench.storage.campaigns import tiny
from bench.versions import ROOT
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


LONGEST = 3.0  # min


@bench("time of what `make demo` runs after installation, on 2 cores", bar="<= 3 min")
def demo_time(quick: bool) -> Result:
    """Run the preset `demo` into an empty directory; quick: stopped after 55 s."""
    with TemporaryDirectory() as scratch:
        out = Path(scratch) / "demo"
        done = finish(
            [sys.executable, "-m", "bns", "run", "demo", "--out", str(out)],
            limit=55.0 if quick else 4 * LONGEST * 60.0,
            environment={"OMP_NUM_THREADS": "1", "RERUN_ANALYTICS": "0"},
        )
        files = sorted(p.relative_to(out) for p in out.rglob("*") if p.is_file())
        size = sum((out / path).stat().st_size for path in files)
    minutes = done.seconds / 60.0
    finished = done.code == 0
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=None if quick and done.code is None else finished and minutes <= LONGEST,
        n=1,
        details={
            "finished": finished,
            "exit_code": done.code,
            "files": [str(path) for path in files],
            "bytes": size,
            "last_lines": done.output.strip().splitlines()[-8:],
        },
    )


DEMO_SIZE = 1.2  # GB = 10^9 bytes
DEMO_TIME = 2.5  # min, with the installation


@bench(
    "size of .venv after `make demo` in a fresh clone, and its time on 2 cores",
    bar="<= 1.2 GB, <= 2.5 min",
)
def demo_bare(quick: bool) -> Result:
    """Run `make demo` on what is committed; quick: its installation alone.

    Packages come from pip's index or from its cache: the time depends on the line.
    """
    with TemporaryDirectory() as scratch:
        clone = Path(scratch) / "clone"
        cloned = ["git", "clone", "--quiet", str(ROOT), str(clone)]
        subprocess.run(cloned, check=True)
        done = finish(
            ["make", ".venv/.demo" if quick else "demo", f"PYTHON={sys.executable}"],
            limit=4 * DEMO_TIME * 60.0,
            environment={"PYTHONDONTWRITEBYTECODE": ""},
            place=clone,
        )
        report = (clone / "runs" / "demo" / "report.html").is_file()
        packages = _packages(clone / ".venv")
    size, minutes = sum(packages.values()) / 1e9, done.seconds / 60.0
    whole = done.code == 0 and report
    largest = sorted(packages, key=packages.__getitem__, reverse=True)[:12]
    return Result(
        figure=round(size, 3),
        unit="GB",
        holds=None if quick else whole and size <= DEMO_SIZE and minutes <= DEMO_TIME,
        n=1,
        details={
            "exit_code": done.code,
            "report": report,
            "minutes": round(minutes, 2),
            "megabytes": {name: round(packages[name] / 1e6, 1) for name in largest},
            "last_lines": done.output.strip().splitlines()[-8:],
        },
    )


def _packages(environment: Path) -> dict[str, int]:
    """Bytes of the files of an environment, by what lies in its site-packages."""
    found: Counter[str] = Counter()
    for path in environment.rglob("*"):
        if path.is_file() and not path.is_symlink():
            parts = path.relative_to(environment).parts
            at = parts.index("site-packages") + 1 if "site-packages" in parts else 0
            found[parts[at]] += path.stat().st_size
    return found


SUITE_LIMIT = 8.0  # min
SHARE = 8  # a quick figure runs every so many-th test file


@bench("time of the whole test suite, one process, on 2 cores", bar="<= 8 min")
def suite_time(quick: bool) -> Result:
    """Run pytest in a process of its own; quick: a share of the files, scaled up."""
    files = sorted(str(p.relative_to(ROOT)) for p in ROOT.glob("tests/**/test_*.py"))
    chosen = files[::SHARE] if quick else []
    done = finish(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *chosen],
        limit=55.0 if quick else 3 * SUITE_LIMIT * 60.0,
        environment={"OMP_NUM_THREADS": "1", "RERUN_ANALYTICS": "0"},
    )
    scale = len(files) / len(chosen) if quick else 1.0
    minutes = done.seconds * scale / 60.0
    passed = done.code == 0
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=passed and minutes <= SUITE_LIMIT,
        n=1,
        details={
            "passed": passed,
            "exit_code": done.code,
            "files": len(chosen or files),
            "files_in_suite": len(files),
            "last_line": (done.output.strip().splitlines() or [""])[-1],
        },
    )


if __name__ == "__main__":
    os.environ.setdefault("OMP_NUM_THREADS", sys.argv[2])
    print(json.dumps(case(int(sys.argv[1]), int(sys.argv[2]), sys.argv[3])))
