"""What the benches of the hardware mode share."""

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator
from pathlib import Path

from bench.runner import write

KEPT = Path("runs") / "bench"  # where parts of long benches are kept


def resumed(name: str) -> Callable[[str, Callable[[], dict]], dict]:
    """What measures a part of a long bench, or reads it where it was measured.

    Args:
        name: of the bench.

    Parts that were measured with other code are not taken.
    """
    folder = KEPT / name / _code()

    def part(label: str, measure: Callable[[], dict]) -> dict:
        path = folder / f"{label}.json"
        if path.exists():
            return json.loads(path.read_text())
        row = measure()
        folder.mkdir(parents=True, exist_ok=True)
        write(path, json.dumps(row))
        return row

    return part


def _code() -> str:
    """What the code of robots and of their benches is, in a few letters."""
    places = Path("hardware"), Path("bench", "hardware")
    files = [path for place in places for path in place.rglob("*.py")]
    texts = (path.read_bytes() for path in sorted(files))
    return hashlib.sha256(b"".join(texts)).hexdigest()[:12]


@contextlib.contextmanager
def folder() -> Iterator[Path]:
    """A directory for a port, gone afterwards."""
    with tempfile.TemporaryDirectory(prefix="bns-") as path:
        yield Path(path)


@contextlib.contextmanager
def emulator(port: Path, *words: str, robot: str = "khepera3") -> Iterator[object]:
    """`bns hardware emulate` on a port; ends it afterwards."""
    command = [sys.executable, "-m", "bns", "hardware", "emulate", robot]
    command += ["--port", str(port), *words]
    process = subprocess.Popen(command, stdout=subprocess.PIPE, text=True)
    until = time.monotonic() + 60
    while not port.exists() and time.monotonic() < until:
        time.sleep(0.02)
    try:
        yield process
    finally:
        process.send_signal(signal.SIGTERM)
        try:
            process.wait(5)
        except subprocess.TimeoutExpired:
            process.kill()


def learned(words: list[str], path: Path) -> str:
    """`bns run PRESET ... --world hardware` on the robot at `path / "robot"`.

    A session that was stopped is gone on with, as a person would. The run is in
    `path / "run"`; gives the end of what was said.
    """
    command = [sys.executable, "-m", "bns", "run", *words, "--world", "hardware"]
    command += ["--port", str(path / "robot"), "--out", str(path / "run")]
    command += ["--no-report", "--rerun", "off"]
    said = ""
    for _ in range(5):
        done = subprocess.run(command, capture_output=True, text=True, check=False)
        said += done.stdout[-300:] + done.stderr[-300:]
        if done.returncode == 0:
            break
        command = [w for w in command if w != "--resume"] + ["--resume"]
    return said


def alive(pid: int) -> bool:
    """Whether a process is there."""
    try:
        os.kill(pid, 0)
    except ProcessLookupError:
        return False
    return True
