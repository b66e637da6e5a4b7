"""From an MJCF and a log to a verdict, without a file edited: four robots."""

import contextlib
import io
import tempfile
from pathlib import Path
from time import perf_counter

import numpy as np

from bench.gap.describe_logs import ROBOTS, Logged
from bench.result import Result, bench

SEED, TRIALS, FEW = 11, 6, 3


@bench(
    "robots that come from an MJCF and a log to a verdict without editing a file",
    bar="4 of 4",
)
def gap_describe(quick: bool) -> Result:
    """Describe and diagnose each; `quick`: describe only, shorter logs."""
    details = {}
    for number, (name, make) in enumerate(ROBOTS.items()):
        rng = np.random.default_rng([SEED, number])
        with tempfile.TemporaryDirectory() as place:
            logged = make(Path(place), rng, FEW if quick else TRIALS)
            details[name] = _tried(logged, Path(place), quick)
    good = sum(bool(row["holds"]) for row in details.values())
    return Result(
        figure=good,
        unit="of 4",
        holds=good == len(ROBOTS),
        n=len(ROBOTS),
        details=details,
    )


def _tried(logged: Logged, place: Path, quick: bool) -> dict[str, object]:
    begin = perf_counter()
    own, out = place / "own.toml", place / "out"
    words = [str(logged.model), str(logged.log), "--out", str(own), *logged.words]
    heard = _ran(["describe", *words])
    found = _parts(own) if own.exists() else {}
    row: dict[str, object] = {"channels": found == logged.parts, "holds": False}
    if own.exists() and not quick:
        words = [str(logged.log), "--model", str(own), "--out", str(out)]
        heard = _ran(["diagnose", *words, "--no-report", "--no-rerun"])
        row["said"] = heard.partition("\n")[0][:200]
    elif not own.exists():
        row["said"] = heard[:200]
    said = quick or (out / "diagnosis.json").is_file()
    row["holds"] = bool(row["channels"] and said)
    row["seconds"] = round(perf_counter() - begin, 1)
    return row


def _parts(own: Path) -> dict[str, tuple[str, str]]:
    from bns.gap.models.mjcf.config import OwnConfig

    seen = OwnConfig.read(own).seen
    return {item.channel.name: (item.quantity, item.part) for item in seen}


def _ran(words: list[str]) -> str:
    """What `bns gap` says to some words."""
    from bns.__main__ import main

    heard = io.StringIO()
    with contextlib.redirect_stdout(heard), contextlib.redirect_stderr(heard):
        main(["gap", *words])
    return heard.getvalue()
