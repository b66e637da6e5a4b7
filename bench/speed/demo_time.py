"""How long the demonstration takes once everything is installed."""

import sys
from pathlib import Path
from tempfile import TemporaryDirectory

from bench.processes import finish
from bench.result import Result, bench

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
