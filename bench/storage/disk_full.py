"""A disk that is full at every write of a run, a campaign, a diagnosis, one by one."""

import errno
import io
import os
import shutil
import subprocess
import tempfile
from collections.abc import Callable, Iterator
from contextlib import contextmanager, redirect_stdout
from pathlib import Path
from unittest import mock

from bench.result import Result, bench
from bench.storage.campaigns import drives, tiny
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
