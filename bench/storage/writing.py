"""Writing where it goes wrong: on a disk that is full, and by two processes at once.

The disk is full at every write of a run, a campaign, a diagnosis, one by one. Of two
processes told to write into one directory one does, the other may not.
"""

import errno
import io
import json
import multiprocessing
import os
import shutil
import subprocess
import sys
import tempfile
import time
from collections import Counter
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stderr, redirect_stdout
from pathlib import Path
from unittest import mock

from bench.result import Result, bench
from bench.runner import RESULTS
from bench.storage.campaigns import drives, rows_of, text, tiny
from bns import seeding
from bns.errors import BnsError

SMALL = (8, 24, 48, 96, 160, 256, 384, 640, 1024)  # [KiB] of real file systems
MOST = 400  # writes of one command


class Full:
    """Lets so many calls through that bring bytes to the disk, then none.

    Args:
        left: calls that succeed; every later one fails with "no space left".
    """

    def __init__(self, left: int):
        self.left, self.calls = left, 0

    def spend(self) -> None:
        """Count a call.

        Raises:
            OSError: there is no space left.
        """
        self.calls += 1
        if self.calls > self.left:
            raise OSError(errno.ENOSPC, os.strerror(errno.ENOSPC))

    @contextmanager
    def __call__(self) -> Iterator[None]:
        """Patch what writes: bytes of files, synchronising, making directories."""
        fsync, mkdir, write = os.fsync, Path.mkdir, Path.write_bytes

        def synchronise(descriptor: int) -> None:
            self.spend()
            fsync(descriptor)

        def make(path: Path, *given, **named) -> None:
            self.spend()
            mkdir(path, *given, **named)

        def whole(path: Path, data: bytes) -> int:
            try:
                self.spend()
            except OSError:
                write(path, data[: len(data) // 2])  # as much as there was room for
                raise
            return write(path, data)

        with (
            mock.patch("os.fsync", synchronise),
            mock.patch.object(Path, "mkdir", make),
            mock.patch.object(Path, "write_bytes", whole),
        ):
            yield


@bench(
    "no space at each write of a run, a campaign, a diagnosis: what was there is lost",
    bar="0 writes",
)
def disk_full(quick: bool) -> Result:
    """Fail at each write in turn, compare with before, then repeat the command."""
    lost: list[str] = []
    writes: dict[str, int] = {}
    with tempfile.TemporaryDirectory() as name:
        home = Path(name)
        for kind, act in _acts(home).items():
            writes[kind] = _swept(home / kind, kind, act, lost, 7 if quick else 1)
        real = 0 if quick else _real(home, lost)
    total = sum(writes.values()) + real
    return Result(
        figure=len(lost),
        unit="writes",
        holds=None if quick else not lost,
        n=total,
        details={"writes": writes, "full file systems": real, "lost": lost[:10]},
    )


Act = Callable[[Path], object]


def _acts(home: Path) -> dict[str, Act]:
    """What is done in a directory, by kind; the same again goes on."""
    from bns.campaign import drive
    from bns.campaign.engines.registry import InlineEngine
    from bns.experiment.run import train

    campaign = tiny(2, trials=2)
    config = campaign.members[0].config
    home.mkdir(exist_ok=True)
    drives(home / "drives")

    def trained(out: Path) -> None:
        train(config, out / "run", resume=True)

    def driven(out: Path) -> None:
        drive.run(campaign, out / "store", InlineEngine(), resume=True)

    def diagnosed(out: Path) -> None:
        _diagnosed(home / "drives", out)

    return {"run": trained, "campaign": driven, "diagnosis": diagnosed}


def _diagnosed(drives: Path, out: Path) -> None:
    """As `bns gap diagnose` does, its report included; finished ones are left alone."""
    from bns.cli.gap import diagnose
    from bns.gap.store import FILE

    place = out / "gap"
    if (place / FILE).exists() and not (place / "request.json").exists():
        return
    given = diagnose.Diagnose(
        data=(str(drives),), out=str(place), rerun=False, threads=1
    )
    with redirect_stdout(io.StringIO()):
        diagnose._diagnose(given)


def _content(place: Path) -> dict[str, bytes]:
    """Bytes of all whole files, by path; journals and what is half-written are not."""
    return {
        str(path.relative_to(place)): path.read_bytes()
        for path in sorted(place.rglob("*"))
        if path.is_file()
        and path.suffix != ".jsonl"
        and not any(part.startswith(".tmp-") for part in path.parts)
    }


def _swept(place: Path, kind: str, act: Act, lost: list[str], stride: int) -> int:
    """Fail at each write of an act; gives how many there are."""
    for number in range(0, MOST, stride):
        shutil.rmtree(place, ignore_errors=True)
        place.mkdir(parents=True)
        full, failed = Full(number), ""
        (place / "mine.txt").write_bytes(b"kept")
        with full():
            try:
                act(place)
            except BnsError as error:
                failed = str(error)
            except OSError as error:
                lost.append(f"{kind}, write {number}: {error!r} instead of a message")
                failed = "traceback"
        _judge(place, kind, number, act, lost)
        if not failed:
            return full.calls
    return MOST


def _judge(place: Path, kind: str, number: int, act: Act, lost: list[str]) -> None:
    """What was there is there and readable, and the same command again finishes."""
    before = _content(place)
    if before.get("mine.txt") != b"kept":
        lost.append(f"{kind}, write {number}: a file beside is gone")
    try:
        act(place)
    except (BnsError, OSError) as error:
        lost.append(f"{kind}, write {number}: again: {error}")
        return
    after = _content(place)
    for path, data in before.items():
        steps = "/steps/" in path or "/parts/" in path  # they become one file
        rewritten = path.endswith(("state.npz", "request.json", "campaign.toml"))
        rewritten = rewritten or path.startswith("gap/")
        if not (steps or rewritten) and after.get(path) != data:
            lost.append(f"{kind}, write {number}: {path} is another")


def _real(home: Path, lost: list[str]) -> int:
    """The acts on file systems that are too small; gives how many were tried."""
    tried = 0
    for kind, act in _acts(home / "real").items():
        for size in SMALL:
            place = home / f"{kind}-{size}"
            place.mkdir()
            made = _mount(place, f"{size}k")
            if not made:
                return tried
            tried += 1
            try:
                (place / "mine.txt").write_bytes(b"kept")
                try:
                    act(place)
                except BnsError:
                    _mount(place, "64m,remount")
                    _judge(place, kind, size, act, lost)
                except OSError as error:
                    lost.append(f"{kind} on {size} KiB: {error!r}")
            finally:
                subprocess.run(["umount", str(place)], check=False)
    return tried


def _mount(place: Path, size: str) -> bool:
    """A file system in memory of its own size, if this user may."""
    command = ["mount", "-t", "tmpfs", "-o", f"size={size}", "tmpfs", str(place)]
    return subprocess.run(command, capture_output=True, check=False).returncode == 0


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
