"""How long the test suite takes."""

import sys

from bench.processes import finish
from bench.result import Result, bench
from bench.versions import ROOT

LIMIT = 8.0  # min
SHARE = 8  # a quick figure runs every so many-th test file


@bench("time of the whole test suite, one process, on 2 cores", bar="<= 8 min")
def suite_time(quick: bool) -> Result:
    """Run pytest in a process of its own; quick: a share of the files, scaled up."""
    files = sorted(str(p.relative_to(ROOT)) for p in ROOT.glob("tests/**/test_*.py"))
    chosen = files[::SHARE] if quick else []
    done = finish(
        [sys.executable, "-m", "pytest", "-p", "no:cacheprovider", *chosen],
        limit=55.0 if quick else 3 * LIMIT * 60.0,
        environment={"OMP_NUM_THREADS": "1", "RERUN_ANALYTICS": "0"},
    )
    scale = len(files) / len(chosen) if quick else 1.0
    minutes = done.seconds * scale / 60.0
    passed = done.code == 0
    return Result(
        figure=round(minutes, 3),
        unit="min",
        holds=passed and minutes <= LIMIT,
        n=1,
        details={
            "passed": passed,
            "exit_code": done.code,
            "files": len(chosen or files),
            "files_in_suite": len(files),
            "last_line": (done.output.strip().splitlines() or [""])[-1],
        },
    )
