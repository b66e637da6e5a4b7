"""Damaged files: fuzzed and with flipped bits."""

import json
import logging
import multiprocessing
import resource
import tempfile
import time
from collections import Counter
from pathlib import Path

import numpy as np

from bench.result import Result, bench
from bench.runner import RESULTS
from bench.storage.readers import fingerprint, readers
from bench.storage.reading import Found, attempt, quiet
from bench.storage.sample_files import make
from bns import seeding
from bns.errors import BnsError

INPUTS, QUICK = 1_000_000, 4000
BLOCK = 50  # seeds of every reader in a process of its own, which may die
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


FLIPS = 400


@bench(
    "single bits flipped in every kind of stored file: accepted with other content",
    bar="0 of 400 a kind",
)
def bit_flips(quick: bool) -> Result:
    """Flip, read, compare every number and word with what was read before."""
    count = 20 if quick else FLIPS
    logging.getLogger("bns").setLevel(logging.ERROR)
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        make(home)
        stored = [reader for reader in readers() if reader.stored]
        kinds = {reader.name: _flipped(reader, home, count) for reader in stored}
    wrong = sum(kind["other content"] + kind["tracebacks"] for kind in kinds.values())
    return Result(
        figure=wrong,
        unit="flips",
        holds=wrong == 0,
        n=count * len(kinds),
        details={"flips a kind": count, "kinds": kinds},
    )


def _flipped(reader, home: Path, count: int) -> dict[str, int]:
    """What comes of flips of one file."""
    path, found = home / reader.file, Counter()
    data, before = path.read_bytes(), fingerprint(reader.read(home))
    rng = seeding.generator(0, "bench", "bit-flips", reader.name)
    bits = rng.choice(8 * len(data), count, replace=8 * len(data) < count)
    for bit in np.asarray(bits):
        made = bytearray(data)
        made[bit // 8] ^= 1 << (bit % 8)
        path.write_bytes(made)
        try:
            same = fingerprint(reader.read(home)) == before
            found["same content" if same else "other content"] += 1
        except BnsError as error:
            found["refused" if "\n" not in str(error) else "tracebacks"] += 1
        except Exception:  # any other is a fault
            found["tracebacks"] += 1
    path.write_bytes(data)
    names = ("refused", "same content", "other content", "tracebacks")
    return {name: found[name] for name in names}
