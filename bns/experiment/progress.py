"""Progress of a run: what the bar says."""

import time
from collections import deque
from collections.abc import Iterator
from contextlib import contextmanager

import numpy as np

from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.experiment.step import Step
from bns.progress import Bar

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
        self.bar: Bar | None = None
        self.before = time.monotonic()
        self.seconds: deque[float] = deque(maxlen=RECENT)

    @contextmanager
    def start(self, done: int = 0) -> Iterator[None]:
        """Show progress inside the block; `done` trials lie behind already."""
        self.first = done
        self.before = time.monotonic()
        if not self.enabled:
            yield
            return
        with Bar(self.name, self.total, done=done) as self.bar:
            yield

    def recall(self, record: RunRecord) -> None:
        """Take note of what a run that is resumed has solved already."""
        self.solved |= (record["solved"] > 0).any(axis=1)

    def update(self, trial: int, step: Step) -> None:
        """Show that a trial is done."""
        if not self.bar:
            return
        now = time.monotonic()
        self.seconds.append(now - self.before)
        self.before = now
        self.solved[: len(step.columns["solved"])] |= (
            step.columns["solved"][: len(self.solved)] > 0
        )
        left = float(np.median(self.seconds)) * (self.total - trial - 1)
        line = f"trial {trial + 1} of {self.total}, about {left:.0f} s left, "
        self.bar.update(
            trial + 1, self.brief(step), line=f"{line}{self.describe(step)}"
        )

    def brief(self, step: Step) -> str:
        """The runs' state in very few words, for a bar."""
        damaged = "damaged, " if step.columns["damaged"].any() else ""
        now = int(np.sum(step.columns["solved"] > 0))
        return f"{damaged}{now} of {len(self.solved)} solve"

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
