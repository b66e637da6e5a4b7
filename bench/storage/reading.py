"""Reading files that were made wrong, and what may come of it."""

import contextlib
import logging
import shutil
import signal
import time
from collections import Counter
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from bench.storage.mutations import mutated, strange
from bench.storage.readers import Reader
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
