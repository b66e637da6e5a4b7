"""Progress over a whole campaign, with an estimate of what is left."""

import sys
import time
from collections.abc import Iterator, Sequence
from contextlib import contextmanager
from typing import Any

from bns.campaign.plan import Job

QUIET_SECONDS = 30.0
"""time between two lines where there is no terminal"""


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
        self.began = self.spoke = time.monotonic()
        self.bar: Any = None

    @contextmanager
    def start(self) -> Iterator[None]:
        """Show progress inside the block."""
        if self.enabled and sys.stderr.isatty():
            self._start_bar()
        try:
            yield
        finally:
            if self.bar:
                self.bar.stop()

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
        if not self.enabled:
            return
        now = time.monotonic()
        if self.bar:
            self.bar.update(
                self.task, completed=self.before + self.here, description=self.text()
            )
        elif now - self.spoke >= QUIET_SECONDS:
            self.spoke = now
            print(f"{self.name}: {self.text()}", file=sys.stderr, flush=True)

    def _start_bar(self) -> None:
        from rich.console import Console
        from rich.progress import BarColumn, Progress, TextColumn, TimeElapsedColumn

        self.bar = Progress(
            TextColumn(self.name),
            BarColumn(),
            TimeElapsedColumn(),
            TextColumn("{task.description}"),
            console=Console(stderr=True),
        )
        self.task = self.bar.add_task("", total=self.total, completed=self.before)
        self.bar.start()


def duration(seconds: float) -> str:
    """A time in words: ``about 2 h 10 min``."""
    if seconds == float("inf"):
        return "an unknown time"
    minutes = round(seconds / 60)
    if minutes < 2:
        return f"about {seconds:.0f} s"
    hours, minutes = divmod(minutes, 60)
    return f"about {hours} h {minutes} min" if hours else f"about {minutes} min"
