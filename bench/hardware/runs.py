"""BNS and the diagnosis on emulated robots, their ports and their camera."""

import contextlib
import hashlib
import json
import os
import signal
import subprocess
import sys
import tempfile
import time
from collections.abc import Callable, Iterator, Sequence
from pathlib import Path

import numpy as np

from bench.result import Result, bench
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


TRIALS, ONSET, WINDOW = 64, 20, 75
QUICK = {"trials": 4, "onset": 2}


@bench(
    "one BNS run over an emulated port and camera in real time, wheel damaged midway",
    bar="solved before the damage, and again after it; every trial recorded",
)
def hardware_khepera(quick: bool) -> Result:
    """`bns run khepera-simple --world hardware` on `bns hardware emulate khepera3`.

    The left wheel is 20 % slower from trial 21 on, in software as in the dissertation.
    The SNN trains on the newest 75 patterns: a trial ends at the board's rim, so after
    the damage it has about half of its 12. The figure is the trial of the first
    solution (from 1; 0 = none).
    """
    trials, onset = (QUICK["trials"], QUICK["onset"]) if quick else (TRIALS, ONSET)
    with folder() as path, emulator(path / "robot"):
        begin = time.monotonic()
        said = _learn(path, trials, onset)
        took = time.monotonic() - begin
        return _result(path / "run", onset, took, said)


def _learn(path: Path, trials: int, onset: int) -> str:
    words = ["khepera-simple", "--trials", str(trials)]
    words += ["--adaptation.window", str(WINDOW)]
    words += ["--world.damage", f"wheel_gain:wheel=left,factor=0.8@{onset}"]
    return learned(words, path)


def _result(directory: Path, onset: int, took: float, said: str) -> Result:
    from bns.storage.store import load
    from bns.worlds.data import dataset

    record = load(directory)
    solved = np.flatnonzero(record["solved"][0] > 0)
    before, after = solved[solved < onset], solved[solved >= onset]
    details: dict[str, object] = {
        "trials": record.trials,
        "damaged from trial": onset + 1,
        "solved before": (before + 1).tolist(),
        "solved after": (after + 1).tolist(),
        "minutes": round(took / 60, 2),
        "generations per trial, median": float(np.median(record["generations"])),
        "cost": np.round(record["fitness"][0], 0).tolist(),
        "load of the machine (1 min)": round(os.getloadavg()[0], 1),
        "said": said[-600:],
    }
    if (directory / "dataset").exists():
        held = dataset.read(directory / "dataset").trials
        kept = [trial.conditions for trial in held]
        details["recorded"] = len(held)
        details["voids"] = sum(len(item["voids"]) for item in kept)
        details["faults"] = sum(item["faults"] for item in kept)
        details["latest command, worst [s]"] = max(item["late"] for item in kept)
    whole = details.get("recorded") == record.trials
    return Result(
        figure=float(before[0] + 1) if len(before) else 0.0,
        unit="trials",
        holds=bool(len(before) and len(after) and whole),
        n=1,
        details=details,
    )


WALKS, WALK_ONSET = 30, 20
WALK_QUICK = {"trials": 2, "onset": 1}
DAMAGE = "leg_raised:legs=1,5,blend=1"
ADEQUATE = 0.70  # m, `walk.adequate`: what a tripod gait by hand covers, about
MOST = 0.05  # share of frames


@bench(
    "a walk learned over an emulated bus in real time, two legs raised midway",
    bar="a walk learned over 20 trials, damage applied; <= 5 % deadlines missed",
)
def hardware_phantomx(quick: bool) -> Result:
    """`bns run hexapod-walk --world hardware` on `bns hardware emulate phantomx`.

    A walk is learned where a controller carries the robot 0.70 m within the first 20
    trials, of which 5 are random. Then legs 1 and 5 are held up, in software. A frame
    goes out every 33 ms, the goals of 18 servos and the reading of four; it is missed
    where it is 5 ms late. The figure is the share of frames missed.
    """
    trials, onset = (
        (WALK_QUICK["trials"], WALK_QUICK["onset"]) if quick else (WALKS, WALK_ONSET)
    )
    with folder() as path, emulator(path / "robot", robot="phantomx"):
        begin = time.monotonic()
        words = ["hexapod-walk", "--trials", str(trials)]
        words += ["--world.damage", f"{DAMAGE}@{onset}"]
        said = learned(words, path)
        took = time.monotonic() - begin
        return _walk_result(path / "run", onset, took, said)


def _walk_result(directory: Path, onset: int, took: float, said: str) -> Result:
    from bns.storage.store import load
    from bns.worlds.data import dataset

    record = load(directory)
    ways = record["distance"][0]
    held = dataset.read(directory / "dataset").trials
    kept = [trial.conditions for trial in held]
    frames, missed = (sum(item[key] for item in kept) for key in ("frames", "missed"))
    first = ways[: record.config.evolve_from]
    before, after = ways[record.config.evolve_from : onset], ways[onset:]
    best = float(before.max(initial=0.0))
    share = missed / max(frames, 1)
    walks = best >= ADEQUATE and len(after) > 0
    return Result(
        figure=round(100 * share, 3),
        unit="% missed",
        holds=bool(walks and share <= MOST and len(held) == record.trials),
        n=frames,
        details={
            "trials": record.trials,
            "damaged from trial": onset + 1,
            "distance [m]": np.round(ways, 3).tolist(),
            "random trials, median [m]": round(float(np.median(first)), 3),
            "best before the damage [m]": round(best, 3),
            "best after it [m]": round(float(after.max(initial=0.0)), 3),
            "generations per trial, median": float(np.median(record["generations"])),
            "minutes": round(took / 60, 2),
            "latest frame [s]": max(item["late"] for item in kept),
            "recorded": len(held),
            "ended early": sum(trial.outcome.stopped for trial in held),
            "fell": sum(trial.outcome.fell for trial in held),
            "voids": sum(len(item["voids"]) for item in kept),
            "faults": sum(item["faults"] for item in kept),
            "load of the machine (1 min)": round(os.getloadavg()[0], 1),
            "said": said[-400:],
        },
    )


HIDDEN = "wheel_gain:wheel=left,factor=0.85"
RECORDED, COMMANDS = 8, 10
RATE = 30.0  # pictures a second


@bench(
    "a recording over the emulated port, camera and tracker, its hidden effect named",
    bar="the withheld effect is named",
)
def hardware_gap(quick: bool) -> Result:
    """Excitation as `bns hardware record` drives it, on a robot with a weak wheel.

    Virtual time: line, drawn frames and tracker as in a session. The figure is 1 where
    the verdict names the effect, alone or among others, else 0. A second robot, with
    nothing wrong, is recorded and diagnosed the same way; what is said of it is in the
    details.
    """
    count = 4 if quick else RECORDED
    found, world, trials = _rehearsed([HIDDEN], count)
    named = [list(names) for names in found.verdict.named]
    hit = any("wheel_gain" in name for names in named for name in names)
    spread = np.concatenate([np.diff(t.times) for t in trials])
    sound = None if quick else _rehearsed([], count)[0].verdict
    return Result(
        figure=float(hit),
        unit="named",
        holds=hit,
        n=count,
        details={
            "withheld": HIDDEN,
            "verdict": found.verdict.sentence,
            "named": named,
            "fits": [list(fit.effects) for fit in found.fits[:3]],
            "noise that was found [m, m, rad]": found.floor["sigma"],
            "sample step, median [s]": round(float(np.median(spread)), 4),
            "void trials": world.voids,
            "without an effect": sound.sentence if sound else "not run",
        },
    )


def _rehearsed(effects: Sequence[str], count: int):
    """Diagnosis, world and trials of an emulated robot that was recorded."""
    from bns.gap.diagnose import diagnose
    from bns.gap.models.wheeled.model import WheeledModel
    from bns.hardware.driving.excitation import START, commands
    from bns.hardware.emulators import run
    from bns.hardware.worlds.wheeled import HardwareWorld

    rig = run.rig(effects, rate=RATE, seed=2)
    world = HardwareWorld(rig=rig, sample_dt=0.05, start=START, recording=True)
    trials = []
    for number in range(count):
        told = commands(COMMANDS, seed=1, number=number // 2)
        trials += world.run([told], trial=number)
    found = diagnose(trials, WheeledModel("khepera3", threads=1), full=False)
    return found, world, trials
