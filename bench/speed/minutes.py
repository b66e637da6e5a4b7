"""How long the demonstration and the test suite take."""

import subprocess
import sys
from collections import Counter
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
