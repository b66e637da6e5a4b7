"""The engine that needs nothing: this process, one batch after another."""

import time
from collections.abc import Generator, Sequence
from functools import partial

from bns.campaign import work
from bns.campaign.engines.base import Beat, Outcome, outcome
from bns.campaign.plan import Job


class InlineEngine:
    """Batches run in this process."""

    name = "inline"

    def run(self, jobs: Sequence[Job], *, beat: Beat) -> Generator[Outcome, None, None]:
        """See `Engine.run`."""
        for job in jobs:
            started = time.monotonic()
            given = work.timed(job.to_mapping(), partial(beat, job.key))
            yield outcome(job.key, given, time.monotonic() - started)
