"""Engines by name, and the one that needs nothing: this process, batch after batch."""

import os
import time
from collections.abc import Generator, Sequence
from functools import partial

from bns.campaign import work
from bns.campaign.engines.base import Beat, Engine, Outcome, outcome
from bns.campaign.plan import Job
from bns.errors import BnsError, UnknownNameError


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
        from bns.campaign.engines.registry import InlineEngine

        return InlineEngine()
    if name == "local":
        from bns.campaign.engines.pool import PoolEngine

        return PoolEngine(count)
    from bns.campaign.engines.ray_engine import RayEngine

    return RayEngine(ray_address, workers=count).check()
