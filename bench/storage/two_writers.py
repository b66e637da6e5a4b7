"""Two processes told to write into one directory: one does, the other may not."""

import io
import json
import multiprocessing
import sys
import tempfile
import time
from collections import Counter
from contextlib import redirect_stderr, redirect_stdout
from pathlib import Path

from bench.result import Result, bench
from bench.runner import RESULTS
from bench.storage.campaigns import drives, rows_of, text
from bns import seeding

PAIRS = 200
LATEST = 1.0  # [s] by which the second is later: as long as the first one takes
KINDS = ("run", "resumed run", "campaign", "run", "diagnosis")
PRELOAD = ["bns.experiment.run", "bns.worlds.physics.wheeled_world", "bns.cli.gap"]
PRELOAD += ["bns.learner", "bns.storage.store", "bns.gap.diagnose", "scipy.optimize"]
KEPT = RESULTS / "two-writers.part.jsonl"
"""a line a pair that is done: a bench that is stopped goes on from there"""

SETTINGS = (
    "--trials", "3", "--replicates", "2", "--record-replicates", "1",
    "--evolution.population", "10", "--evolution.generations", "2",
    "--snn.epochs", "3", "--compiled", "no", "--rerun", "off", "--no-report",
)  # fmt: skip


@bench(
    "two processes told the same --out at random offsets: directories of both",
    bar="0 of 200",
)
def two_writers(quick: bool) -> Result:
    """The two have other seeds, so that what is mixed can be told."""
    count = 4 if quick else PAIRS
    rng = seeding.generator(0, "bench", "two-writers")
    rows, began = [] if quick else rows_of(KEPT), time.monotonic()
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        drives(home / "drives")
        for index in range(count):
            kind = KINDS[index % len(KINDS)]
            offset = float(rng.uniform(0, LATEST)) * float(rng.random() < 0.8)
            if index < len(rows):
                continue
            rows.append(_pair(home, home / str(index), kind, offset))
            if not quick:
                with KEPT.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(rows[-1]) + "\n")
    mixed = [row for row in rows if row["fault"]]
    return Result(
        figure=len(mixed),
        unit="mixed or unfinished directories",
        holds=not mixed if not quick else None,
        n=count,
        details={
            "pairs a kind": dict(Counter(row["kind"] for row in rows)),
            "said to the second": dict(Counter(row["said"] for row in rows)),
            "faults": mixed[:10],
            "seconds in this session": round(time.monotonic() - began),
        },
    )


def _words(home: Path, out: Path, kind: str, seed: int) -> list[str]:
    if kind == "diagnosis":
        own = ["--out", str(out), "--seed", str(seed), "--no-report", "--no-rerun"]
        return ["gap", "diagnose", str(home / "drives"), *own]
    if kind == "campaign":
        file = home / f"{seed}.toml"
        file.write_text(f"seed = {seed}\n" + text(2, trials=2, replicates=2))
        own = ["--out", str(out), "--engine", "inline", "--resume"]
        return ["campaign", "run", str(file), *own]
    again = ["--resume"] if kind == "resumed run" else []
    return ["run", "demo", "--out", str(out), "--seed", str(seed), *SETTINGS, *again]


def _command(words: list[str], said: Path) -> None:
    """`bns WORDS` in this process, which has imported all that it needs."""
    import torch

    from bns.__main__ import main

    torch.set_num_threads(1)
    with said.open("w") as file, redirect_stderr(file), redirect_stdout(io.StringIO()):
        code = main(words)
    sys.exit(code)


def _start(words: list[str], said: Path):
    context = multiprocessing.get_context("forkserver")
    context.set_forkserver_preload(PRELOAD)
    process = context.Process(target=_command, args=(words, said))
    process.start()
    return process


def _pair(home: Path, out: Path, kind: str, offset: float) -> dict:
    """What came of two processes; `fault` is "" where one did all of it alone."""
    files = [home / f"said-{seed}.txt" for seed in (1, 2)]
    first = _start(_words(home, out, kind, 1), files[0])
    time.sleep(offset)
    second = _start(_words(home, out, kind, 2), files[1])
    for process in (first, second):
        process.join()
    codes = [first.exitcode, second.exitcode]
    lines = [_lines(file) for file in files]
    refused = [
        code == 2 and len(line) == 1 for code, line in zip(codes, lines, strict=True)
    ]
    fault = ""
    if sorted(codes) != [0, 2] or sum(refused) != 1:
        fault = f"exit codes {codes}: {[line[-1:] for line in lines]}"
    else:
        fault = _mixed(out, kind, 1 + codes.index(0))
    loser = lines[codes.index(2)][-1] if 2 in codes and sum(refused) else ""
    why = next((w for w in ("another process", "already", "was made", "finished diag",
                            "unfinished") if w in loser), "other")  # fmt: skip
    return {"kind": kind, "offset": round(offset, 2), "said": why, "fault": fault}


def _lines(file: Path) -> list[str]:
    """What a process said of itself; progress is not counted."""
    return [line for line in file.read_text().splitlines() if line.startswith("bns: ")]


def _mixed(out: Path, kind: str, seed: int) -> str:
    """What in a directory is not of the process with that seed; "" = nothing."""
    from bns.campaign import results
    from bns.gap import store
    from bns.storage.store import load
    from bns.worlds.data import dataset

    if kind == "diagnosis":
        found = store.load(out)
        held = {path.name for path in out.iterdir()}
        return "" if (found.seed, held) == (seed, {"diagnosis.json"}) else f"{held}"
    if kind == "campaign":
        read = results.read(out)
        seeds = {json.dumps(part.facts["world_seed"]) for part in read.store.read()}
        whole = results.status(read)["runs"] == 4 and read.store.seed == seed
        return "" if whole and len(seeds) == 1 else f"world seeds {seeds}"
    record = load(out)
    kept = dataset.read(out / "dataset").provenance["seed"]
    own = (record.config.seed, kept, record.trials) == (seed, seed, 3)
    return "" if own else f"seeds {record.config.seed}, {kept}"
