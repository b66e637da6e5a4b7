"""Damaged files: fuzzed and with flipped bits."""

import contextlib
import json
import logging
import multiprocessing
import resource
import shutil
import signal
import tempfile
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bench.result import Result, bench
from bench.runner import RESULTS
from bench.storage.campaigns import rows_of
from bench.storage.mutations import mutated, strange
from bench.storage.readers import Reader, fingerprint, readers
from bench.storage.sample_files import make
from bns import seeding
from bns.errors import LONGEST, BnsError

SLOW = 5.0  # [s] of the processor that a reading may take
ASLEEP = 60.0  # [s] that it may take in all: who waits for ever needs no processor
STRANGE = 0.01  # share of inputs that are no file at all


class Hang(BaseException):
    """A reading takes too long; no handler of errors catches it."""


@dataclass
class Found:
    """What came of some inputs.

    Attributes:
        counts: of inputs, refusals, acceptances and of all that must not be.
        cases: a line on each of the first that must not be.
    """

    counts: Counter = field(default_factory=Counter)
    cases: list[str] = field(default_factory=list)

    def bad(self, kind: str, reader: Reader, seed: int, about: object) -> None:
        """Count something that must not be."""
        self.counts[kind] += 1
        if sum(reader.name in case for case in self.cases) < 4:
            self.cases.append(f"{kind}: {reader.name}, seed {seed}: {about!s:.300}")


def attempt(reader: Reader, home: Path, seed: int, found: Found) -> None:
    """One input, which depends on the reader and the seed alone.

    Args:
        reader: to be tried.
        home: with its files; as before afterwards.
        seed: of the input.
        found: to count in.
    """
    path, rng = home / reader.file, np.random.default_rng([seed, 7])
    data = path.read_bytes()
    shutil.copy(path, home / "kept")
    try:
        if rng.random() < STRANGE:
            path.unlink()
            strange(path, rng)
        else:
            path.write_bytes(mutated(data, reader.file, rng))
        found.counts["inputs"] += 1
        judge(reader, home, seed, found)
    finally:
        if path.is_dir() and not path.is_symlink():
            path.rmdir()
        else:
            path.unlink(missing_ok=True)
        (home / "kept").replace(path)


def judge(reader: Reader, home: Path, seed: int, found: Found) -> None:
    """Read what is there, and count what comes of it."""
    began = time.process_time()
    try:
        with _ended():
            content = reader.read(home)
            wrong = reader.sane(content)
        found.counts["accepted"] += 1
        if wrong:
            found.bad("wrong acceptances", reader, seed, wrong)
    except BnsError as error:
        found.counts["refused"] += 1
        said = str(error)
        if not said or len(said) > LONGEST or not said.isprintable():
            found.bad("messages", reader, seed, said)
    except Hang:
        found.bad("hangs", reader, seed, "did not end")
        return
    except Exception as error:  # all that is not a BnsError is a fault
        place = error.__traceback__
        while place and place.tb_next:
            place = place.tb_next
        where = (
            f"{place.tb_frame.f_code.co_filename}:{place.tb_lineno}" if place else ""
        )
        found.bad("tracebacks", reader, seed, f"{error!r} {where}")
    if (took := time.process_time() - began) > SLOW:
        found.bad("hangs", reader, seed, f"{took:.1f} s of the processor")


@contextlib.contextmanager
def _ended() -> Iterator[None]:
    """End a reading that takes too long, by the processor's time or by the clock.

    On a busy machine the clock alone would count other programs' time.

    Raises:
        Hang: inside.
    """

    def late(*_: object) -> None:
        raise Hang

    clocks = (signal.ITIMER_PROF, 2 * SLOW), (signal.ITIMER_REAL, ASLEEP)
    before = {n: signal.signal(n, late) for n in (signal.SIGPROF, signal.SIGALRM)}
    for clock, seconds in clocks:
        signal.setitimer(clock, seconds)
    try:
        yield
    finally:
        for clock, _ in clocks:
            signal.setitimer(clock, 0)
        for number, handler in before.items():
            signal.signal(number, handler)


def quiet() -> None:
    """No warnings of files without a checksum."""
    logging.getLogger("bns").setLevel(logging.ERROR)


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
        rows = [] if quick else rows_of(KEPT)
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
