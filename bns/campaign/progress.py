"""Progress over a whole campaign, with an estimate of what is left."""

import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager

from bns.campaign.plan import Job
from bns.progress import Bar, duration


class Progress:
    """What a campaign shows of itself on the standard error stream.

    Work is counted in trials of runs; what a batch has done so far counts as well.

    Args:
        name: of the campaign.
        jobs: what this session has to run.
        done: trials of runs that lie behind already.
        enabled: False shows nothing.
    """

    def __init__(
        self, name: str, jobs: Sequence[Job], done: int, *, enabled: bool = True
    ):
        self.name, self.enabled = name, enabled
        self.jobs = {job.key: job for job in jobs}
        self.before, self.total = done, done + sum(job.work for job in jobs)
        self.share = dict.fromkeys(self.jobs, 0.0)
        self.ended = self.failed = 0
        self.began = time.monotonic()
        self.bar: Bar | None = None

    @contextmanager
    def start(self) -> Iterator[None]:
        """Show progress inside the block."""
        if not self.enabled:
            yield
            return
        with Bar(self.name, self.total, done=self.before, counted=False) as self.bar:
            yield

    def beat(self, key: str, trials: int) -> None:
        """A batch has done so many trials."""
        job = self.jobs[key]
        longest = next(iter(job.configs.values())).trials
        self.share[key] = min(1.0, trials / longest)
        self._show()

    def end(self, key: str, *, failed: bool) -> None:
        """A batch has ended."""
        self.share[key] = 1.0
        self.ended += 1
        self.failed += failed
        self._show()

    @property
    def here(self) -> float:
        """Trials of runs done in this session."""
        return sum(self.share[key] * job.work for key, job in self.jobs.items())

    def left(self) -> float:
        """Estimated time to the end [s]; infinite before anything is done."""
        here, seconds = self.here, time.monotonic() - self.began
        todo = self.total - self.before - here
        return seconds * todo / here if here else float("inf")

    def text(self) -> str:
        """Where the campaign is, in words."""
        share = 100 * (self.before + self.here) / max(self.total, 1)
        said = f"{share:.0f} %, {self.ended} of {len(self.jobs)} batches"
        if self.failed:
            said += f", {self.failed} failed"
        return f"{said}, {duration(self.left())} left"

    def _show(self) -> None:
        if not self.bar:
            return
        failed = f", {self.failed} failed" if self.failed else ""
        brief = f"{self.ended} of {len(self.jobs)} batches{failed}"
        self.bar.update(self.before + self.here, brief, line=self.text())
