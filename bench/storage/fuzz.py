"""Files made wrong, all kinds, read: one line each, or content that makes sense."""

import json
import multiprocessing
import resource
import tempfile
import time
from pathlib import Path

from bench.result import Result, bench
from bench.runner import RESULTS
from bench.storage.readers import make, readers
from bench.storage.reading import Found, attempt, quiet

INPUTS, QUICK = 1_000_000, 4000
BLOCK = 200  # seeds of every reader in a process of its own, which may die
MEMORY = 10 << 30  # [bytes] of address space of such a process
PROCESSES = 1
BAD = ("tracebacks", "hangs", "wrong acceptances", "messages", "crashes")
KEPT = RESULTS / "fuzz.part.jsonl"
"""a line a block that is done: a bench that is stopped goes on from there"""


@bench(
    "files of every kind made wrong and read: tracebacks, hangs, wrong acceptances",
    bar="0 of 1,000,000",
)
def fuzz(quick: bool) -> Result:
    """Every input follows from its reader and seed, so that each can be had again.

    Resumes after the blocks that are in `bench/results/fuzz.part.jsonl`; remove that to
    begin anew, as after a change of readers.
    """
    with tempfile.TemporaryDirectory(dir=_memory()) as name:
        home = Path(name) / "files"
        home.mkdir()
        make(home)
        count = len(readers())
        size = QUICK // count if quick else BLOCK
        wanted = 1 if quick else -(-INPUTS // (size * count))
        rows = [] if quick else _kept()
        todo = [b for b in range(wanted) if b not in {row["block"] for row in rows}]
        for row in _worked(home, todo, size):
            rows.append(row)
            if not quick:
                with KEPT.open("a", encoding="utf-8") as file:
                    file.write(json.dumps(row) + "\n")
    return _result(rows, quick)


def _memory() -> str | None:
    """Where temporary files need no disk, if there is such a place."""
    return "/dev/shm" if Path("/dev/shm").is_dir() else None


def _kept() -> list[dict]:
    if not KEPT.exists():
        return []
    return [json.loads(line) for line in KEPT.read_text(encoding="utf-8").splitlines()]


def _worked(home: Path, todo: list[int], size: int):
    """The rows of blocks as they are done, a few processes at a time."""
    context = multiprocessing.get_context("spawn")
    waiting, going = list(todo), []
    while waiting or going:
        while waiting and len(going) < PROCESSES:
            block, (here, there) = waiting.pop(0), context.Pipe(duplex=False)
            given = (home, block, size, there)
            process = context.Process(target=_block, args=given)
            process.start()
            there.close()
            going.append((block, process, here))
        for item in list(going):
            block, process, here = item
            if here.poll(0.05) or not process.is_alive():
                going.remove(item)
                yield _row(block, here, process)


def _row(block: int, here, process) -> dict:
    """What a process found; of one that died nothing but that it did."""
    try:
        row = here.recv()
    except EOFError:
        process.join()
        said = f"crashes: block {block}, exit code {process.exitcode}"
        row = {"block": block, "counts": {"crashes": 1}, "cases": [said]}
    process.join()
    return row


def _block(home: Path, block: int, size: int, there) -> None:
    """Seeds of a block, all readers, in files of its own."""
    import shutil
    import warnings

    resource.setrlimit(resource.RLIMIT_AS, (MEMORY, MEMORY))
    warnings.simplefilter("ignore")
    quiet()
    found, began = Found(), time.monotonic()
    with tempfile.TemporaryDirectory(dir=_memory()) as name:
        mine = Path(name) / "files"
        shutil.copytree(home, mine)
        for reader in readers():
            reader.read(mine)  # all that it imports is there
            for seed in range(block * size, (block + 1) * size):
                attempt(reader, mine, seed, found)
    seconds = round(time.monotonic() - began, 1)
    row = {"block": block, "counts": dict(found.counts), "cases": found.cases}
    there.send(row | {"seconds": seconds})


def _result(rows: list[dict], quick: bool) -> Result:
    total: dict[str, int] = {}
    for row in rows:
        for name, count in row["counts"].items():
            total[name] = total.get(name, 0) + count
    bad = sum(total.get(name, 0) for name in BAD)
    enough = quick or total.get("inputs", 0) >= INPUTS
    return Result(
        figure=bad,
        unit="tracebacks, hangs, wrong acceptances, bad messages, crashes",
        holds=None if quick else bad == 0 and enough,
        n=total.get("inputs", 0),
        details={
            **{name: total.get(name, 0) for name in ("refused", "accepted", *BAD)},
            "readers": len(readers()),
            "cases": [case for row in rows for case in row["cases"]][:20],
        },
    )
