"""Engines by name, what they have in common, and the one that needs nothing.

That one runs batch after batch in this process.
"""

import os
import time
from collections.abc import Callable, Generator, Sequence
from dataclasses import dataclass
from functools import partial
from typing import Protocol

from bns.campaign import work
from bns.campaign.plan import Job
from bns.errors import BnsError, UnknownNameError

Beat = Callable[[str, int], None]
"""called with a job's key and the trials it has done"""

PATIENCE = 900.0
"""time without a sign of life after which a worker hangs [s]; compiling takes 60"""


@dataclass(frozen=True)
class Outcome:
    """How a batch ended.

    Attributes:
        key: of the job.
        data: the bytes of its part; None where it failed.
        reason: why it failed.
        seconds: from its start to its end, as the driver saw it.
        computed: the part of them in which it was computed.
        attempts: times it was started.
    """

    key: str
    data: bytes | None = None
    reason: str = ""
    seconds: float = 0.0
    attempts: int = 1
    computed: float = 0.0


class Engine(Protocol):
    """Somewhere batches run."""

    name: str

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Generator[Outcome, None, None]:
        """Run all jobs; gives each outcome as soon as it is known.

        Raises:
            BnsError: the engine cannot start.
        """
        ...


def outcome(key: str, timed: tuple[bytes | str, float], seconds: float) -> Outcome:
    """The outcome in what `work.timed` gave.

    Args:
        key: of the job.
        timed: the bytes of its part, or why it failed; and the time it took [s].
        seconds: from its start to its end, as the driver saw it [s].
    """
    given, computed = timed
    if isinstance(given, str):
        return Outcome(key, None, given, seconds, computed=computed)
    return Outcome(key, given, "", seconds, computed=computed)


class InlineEngine:
    """Batches run in this process."""

    name = "inline"

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Generator[Outcome, None, None]:
        """See `Engine.run`."""
        for job in jobs:
            started = time.monotonic()
            given = work.timed(job.to_mapping(), partial(beat, job.key))
            yield outcome(job.key, given, time.monotonic() - started)


NAMES = ("inline", "local", "ray")


def make(name: str, *, workers: int = 0, ray_address: str = "") -> Engine:
    """The engine called `name`.

    Args:
        name: one of `NAMES`.
        workers: processes or CPUs here; 0 = one for each core.
        ray_address: of a Ray cluster; empty starts one here.

    Raises:
        UnknownNameError: no such engine.
        BnsError: settings that do not fit it, Ray is missing, or nobody answers.
    """
    if name not in NAMES:
        raise UnknownNameError("engine", name, NAMES)
    if ray_address and name != "ray":
        raise BnsError(f"--ray-address goes with --engine ray, not with {name!r}.")
    if not 0 <= workers <= 1024:
        raise BnsError(f"--workers {workers} is not allowed: give 1 to 1024.")
    count = workers or len(os.sched_getaffinity(0))
    if name == "inline":
        return InlineEngine()
    if name == "local":
        from bns.campaign.engines.pool import PoolEngine

        return PoolEngine(count)
    from bns.campaign.engines.ray_engine import RayEngine

    return RayEngine(ray_address, workers=count).check()
