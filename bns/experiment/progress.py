"""Progress of a run: a bar with an estimate, or a line now and then."""

import sys
import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager
from typing import Any

import numpy as np

from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.experiment.step import Step

QUIET_SECONDS = 30.0
"""time between two lines where there is no terminal"""

RECENT = 8
"""trials whose median time gives the estimate; the first ones compile"""


class Progress:
    """What a run shows of itself on the standard error stream.

    Args:
        config: of the run.
        enabled: False shows nothing.
    """

    def __init__(self, config: RunConfig, *, enabled: bool = True):
        self.total, self.first = config.trials, 0
        self.name = config.preset or config.task.name
        self.enabled = enabled
        self.solved = np.zeros(config.replicates, dtype=bool)
        self.bar: Any = None
        self.before = self.spoke = time.monotonic()
        self.seconds: deque[float] = deque(maxlen=RECENT)

    @contextmanager
    def start(self, done: int = 0) -> Iterator[None]:
        """Show progress inside the block; `done` trials lie behind already."""
        self.first = done
        self.before = self.spoke = time.monotonic()
        if self.enabled and sys.stderr.isatty():
            self._start_bar()
        try:
            yield
        finally:
            if self.bar:
                self.bar.stop()

    def _start_bar(self) -> None:
        from rich.console import Console
        from rich.progress import (
            BarColumn,
            MofNCompleteColumn,
            Progress,
            TextColumn,
            TimeElapsedColumn,
            TimeRemainingColumn,
        )

        self.bar = Progress(
            TextColumn(self.name),
            BarColumn(),
            MofNCompleteColumn(),
            TimeElapsedColumn(),
            TextColumn("left"),
            TimeRemainingColumn(),
            TextColumn("{task.description}"),
            console=Console(stderr=True),
        )
        self.task = self.bar.add_task("", total=self.total, completed=self.first)
        self.bar.start()

    def recall(self, record: RunRecord) -> None:
        """Take note of what a run that is resumed has solved already."""
        self.solved |= (record["solved"] > 0).any(axis=1)

    def update(self, trial: int, step: Step) -> None:
        """Show that a trial is done."""
        if not self.enabled:
            return
        now = time.monotonic()
        self.seconds.append(now - self.before)
        self.before = now
        self.solved[: len(step.columns["solved"])] |= (
            step.columns["solved"][: len(self.solved)] > 0
        )
        text = self.describe(step)
        if self.bar:
            self.bar.update(self.task, completed=trial + 1, description=text)
        elif now - self.spoke >= QUIET_SECONDS:
            self.spoke = now
            left = float(np.median(self.seconds)) * (self.total - trial - 1)
            print(
                f"{self.name}: trial {trial + 1} of {self.total}, "
                f"about {left:.0f} s left, {text}",
                file=sys.stderr,
                flush=True,
            )

    def describe(self, step: Step) -> str:
        """The runs' state in a few words."""
        columns = step.columns
        now = int(np.sum(columns["solved"] > 0))
        fitness = float(np.median(columns["fitness"]))
        damaged = ", damaged" if columns["damaged"].any() else ""
        return (
            f"median cost {fitness:.0f}, solved by {now} of {len(self.solved)} now, "
            f"{int(self.solved.sum())} ever{damaged}"
        )
