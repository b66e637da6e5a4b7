"""How long the demonstration and the test suite take."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.processes import finish
from bench.result import Result, bench
from bench.versions import ROOT

LIMIT = 3.0  # min


@bench("time of what `make demo` runs after installation, on 2 cores", bar="<= 3 min")
def demo_time(quick: bool) -> Result:
    """Run the preset `demo` into an empty directory; quick: stopped after 55 s."""
    with TemporaryDirectory() as scratch:
        out = Path(scratch) / "demo"
        done = finish(
            [sys.executable, "-m", "bns", "run", "demo", "--out", str(out)],
            limit=55.0 if quick else 4 * LIMIT * 60.0,
            environment={"OMP_NUM_THREADS": "1", "RERUN_ANALYTICS": "0"},
        )
        files = sorted(p.relative_to(out) for p in out.rglob("*") if p.is_file())
        size = sum((out / path).stat().st_size for path in files)
    minutes = done.seconds / 60.0
    finished = done.code == 0
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=None if quick and done.code is None else finished and minutes <= LIMIT,
        n=1,
        details={
            "finished": finished,
            "exit_code": done.code,
            "files": [str(path) for path in files],
            "bytes": size,
            "last_lines": done.output.strip().splitlines()[-8:],
        },
    )


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
