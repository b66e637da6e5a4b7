"""Time a command in a process of its own, on as many cores as the bars speak of."""

import os
import subprocess
import time
from collections.abc import Mapping, Sequence
from dataclasses import dataclass
from pathlib import Path

from bench.versions import ROOT

CORES = 2


@dataclass(frozen=True, kw_only=True)
class Finished:
    """A command that ended.

    Attributes:
        seconds: wall time.
        code: exit code; None where the time limit ended it.
        output: standard output and error together.
    """

    seconds: float
    code: int | None
    output: str


def finish(
    words: Sequence[str],
    *,
    limit: float,
    environment: Mapping[str, str] | None = None,
    place: Path = ROOT,
) -> Finished:
    """Run a command on `CORES` cores (fewer where there are fewer).

    Args:
        words: the command and its arguments.
        limit: time after which it is ended [s].
        environment: variables set beside the present ones.
        place: directory that it runs in; the checkout.
    """
    cores = sorted(os.sched_getaffinity(0))
    os.sched_setaffinity(0, cores[:CORES])
    started = time.perf_counter()
    try:
        done = subprocess.run(
            words,
            cwd=place,
            env={**os.environ, **(environment or {})},
            stdin=subprocess.DEVNULL,
            stdout=subprocess.PIPE,
            stderr=subprocess.STDOUT,
            text=True,
            timeout=limit,
            check=False,
        )
        code, output = done.returncode, done.stdout
    except subprocess.TimeoutExpired as expired:
        code, output = None, (expired.stdout or b"").decode(errors="replace")
    finally:
        os.sched_setaffinity(0, cores)
    return Finished(seconds=time.perf_counter() - started, code=code, output=output)
