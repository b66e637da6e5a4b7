"""A CSV log diagnosed with what `pip install bns-testbed[gap]` brings, and its size.

    python -m venv gap
    gap/bin/pip install '.[gap]'
    gap/bin/python .ci/gap_alone.py

Exits with 1 where something else than the effect is named, or the environment has more
than `LIMIT` megabytes.
"""

import csv
import subprocess
import sys
import tempfile
from importlib.util import find_spec
from pathlib import Path

import numpy as np

from bns.worlds import registry
from bns.worlds.trial import Commands

LIMIT = 700
"""largest size of the environment [MB = 10^6 bytes]"""
ABSENT = ("torch", "rerun", "gymnasium", "cv2")
EFFECT = "wheel_gain:wheel=left,factor=0.8"
COLUMNS = """robot = "khepera3"

[columns]
time = "t"
x = {column = "x", unit = "mm"}
y = {column = "y", unit = "mm"}
yaw = {column = "yaw", unit = "deg"}
left_speed = {column = "left", unit = "mm/s"}
right_speed = {column = "right", unit = "mm/s"}
trial = "run"
"""
HEAD = ("run", "t", "x", "y", "yaw", "left", "right")


def main() -> int:
    """Write the log, diagnose it, look at the size; gives the exit code."""
    there = [name for name in ABSENT if find_spec(name)]
    print(f"not wanted, but there: {', '.join(there) or 'nothing'}")
    with tempfile.TemporaryDirectory() as folder:
        named = diagnose(Path(folder))
    size = sum(p.stat().st_size for p in Path(sys.prefix).rglob("*") if p.is_file())
    print(f"effect named: {named}; size: {size / 1e6:.0f} MB, allowed: {LIMIT} MB")
    return int(bool(there) or not named or size > LIMIT * 1e6)


def diagnose(folder: Path) -> bool:
    """Whether the diagnosis of the log names the effect; says what it says."""
    write(folder / "log.csv")
    (folder / "columns.toml").write_text(COLUMNS)
    words = (
        "gap",
        "diagnose",
        folder / "log.csv",
        "--columns",
        folder / "columns.toml",
    )
    done = subprocess.run(
        [
            sys.executable,
            "-m",
            "bns",
            *words,
            "--out",
            folder / "out",
            "--threads",
            "1",
        ],
        check=False,
        capture_output=True,
        text=True,
    )
    print(done.stdout + done.stderr)
    report = folder / "out" / "report.html"
    return done.returncode == 0 and report.exists() and "wheel_gain" in done.stdout


def write(file: Path) -> None:
    """A log of a Khepera III whose left wheel is weak: 6 trials at 20 Hz."""
    rng = np.random.default_rng(0)
    world = registry.make(
        "mujoco",
        robot="khepera3",
        reality=[EFFECT, "tracker_noise:position_sd=0.002,heading_sd=0.01"],
        sample_dt=0.05,
        threads=1,
    )
    speeds = rng.uniform(-0.12, 0.12, (6, 6, 2))
    told = [Commands(values, np.full(6, 1.0)) for values in speeds]
    with file.open("w", newline="") as stream:
        lines = csv.writer(stream)
        lines.writerow(HEAD)
        for number, trial in enumerate(world.run(told)):
            for time, pose in zip(trial.times, trial.poses_world, strict=True):
                sent = 1e3 * speeds[number, min(int(time + 1e-6), 5)]
                place = (1e3 * pose[0], 1e3 * pose[1], np.degrees(pose[2]))
                lines.writerow([number, time, *place, *sent])


if __name__ == "__main__":
    sys.exit(main())
