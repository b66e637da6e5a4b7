"""Killed at ten random moments and resumed: the bytes of an undisturbed run?"""

import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np

from bench.result import Result, bench
from bns import seeding

MAY_DIFFER = ("timing.jsonl",)
SETTINGS = (
    "--trials", "12", "--replicates", "3", "--record-replicates", "2",
    "--evolution.population", "20", "--evolution.generations", "5",
    "--snn.epochs", "20", "--compiled", "no", "--rerun", "off", "--no-report",
    "--world.damage", "wheel_gain:wheel=left,factor=0.8@6",
)  # fmt: skip


@bench(
    "runs killed (SIGKILL) at random moments that resume to the same bytes",
    bar="10 of 10",
)
def resume(quick: bool) -> Result:
    """Kill and resume; a moment is a random share of an undisturbed run's time."""
    count = 2 if quick else 10
    rng = seeding.generator(0, "bench", "resume")
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        whole, first_step = _undisturbed(home / "clean")
        expected = _contents(home / "clean")
        kills = []
        for index in range(count):
            moment = float(rng.uniform(0.5 * first_step, whole))
            trials = _killed(home / f"{index}", moment)
            _finish(home / f"{index}")
            kills.append(
                {
                    "seconds": round(moment, 2),
                    "trials_done": trials,
                    "differing": _differing(_contents(home / f"{index}"), expected),
                }
            )
    same = sum(not kill["differing"] for kill in kills)
    return Result(
        figure=same,
        unit=f"of {count}",
        holds=same == count,
        n=count,
        details={"kills": kills, "undisturbed_seconds": round(whole, 2)},
    )


def _command(out: Path) -> list[str]:
    return [sys.executable, "-m", "bns", "run", "demo", "--out", str(out), *SETTINGS]


def _start(out: Path) -> subprocess.Popen:
    return subprocess.Popen(
        [*_command(out), "--resume"],
        stdout=subprocess.DEVNULL,
        stderr=subprocess.DEVNULL,
        env={**os.environ, "OMP_NUM_THREADS": "1"},
    )


def _undisturbed(out: Path) -> tuple[float, float]:
    """Seconds that a whole run takes, and seconds to its first stored trial."""
    began, first = time.monotonic(), np.inf
    process = _start(out)
    while process.poll() is None:
        if np.isinf(first) and (out / "steps" / "00000.npz").exists():
            first = time.monotonic() - began
        time.sleep(0.01)
    if process.returncode != 0:
        raise RuntimeError(f"the undisturbed run exited with {process.returncode}")
    return time.monotonic() - began, first


def _killed(out: Path, moment: float) -> int:
    """Kill a run after so many seconds; gives the trials it had stored."""
    process = _start(out)
    try:
        process.wait(timeout=moment)
    except subprocess.TimeoutExpired:
        process.send_signal(signal.SIGKILL)
        process.wait()
    return len(list((out / "steps").glob("[0-9]*.npz")))


def _finish(out: Path) -> None:
    process = _start(out)
    if process.wait() != 0:
        raise RuntimeError(f"the resumed run exited with {process.returncode}")


def _contents(directory: Path) -> dict[str, bytes]:
    """Bytes of every file, the commit's name left out: it may change meanwhile."""
    head = json.loads((directory / "run.json").read_bytes())
    commit = head["versions"]["commit"].encode()
    return {
        str(path.relative_to(directory)): path.read_bytes().replace(commit, b"commit")
        for path in sorted(directory.rglob("*"))
        if path.is_file() and path.name not in MAY_DIFFER
    }


def _differing(one: dict[str, bytes], other: dict[str, bytes]) -> list[str]:
    names = sorted({*one, *other})
    return [name for name in names if one.get(name) != other.get(name)]
