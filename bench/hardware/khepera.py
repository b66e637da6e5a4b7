"""BNS on the emulated Khepera III, its port and its camera, in real time."""

import os
import time
from pathlib import Path

import numpy as np

from bench.hardware.emulated import emulator, folder, learned
from bench.result import Result, bench

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
