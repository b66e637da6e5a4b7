"""Progress on the standard error stream: a bar with an estimate, or lines.

A bar fits 80 columns and gets wider with the terminal. Without a terminal a line is
written every `QUIET_SECONDS`, so that a log stays short.
"""

import sys
import time
from collections.abc import Callable, Iterator, Sequence
from contextlib import contextmanager
from typing import Any, TypeVar

Item = TypeVar("Item")

QUIET_SECONDS = 30.0
"""time between two lines where there is no terminal [s]"""
NAME, TEXT = 16, 26
"""widest name and widest text of a bar on 80 columns [characters]"""


class Bar:
    """A bar, or lines, for work whose amount is known.

    Args:
        name: of the work.
        total: how much there is, in any unit.
        done: how much lies behind already.
        counted: show done and total as numbers.
    """

    def __init__(
        self, name: str, total: float, *, done: float = 0, counted: bool = True
    ):
        self.name, self.total, self.done = name, total, done
        self.began = self.spoke = time.monotonic()
        self.before = done
        self.bar: Any = None
        if sys.stderr.isatty():
            self.bar = _bar(counted)
            shown = name if len(name) <= NAME else f"{name[: NAME - 1]}…"
            self.task = self.bar.add_task(
                "", total=total, completed=done, name=shown, text=""
            )
            self.bar.start()

    def __enter__(self) -> "Bar":
        return self

    def __exit__(self, *_: object) -> None:
        if self.bar:
            self.bar.stop()

    def update(self, done: float, text: str = "", *, line: str = "") -> None:
        """So much is done now.

        Args:
            done: in the unit of the total.
            text: says more, in few words.
            line: what is written where there is no terminal, instead of how much of
                the total is done, what is left and the text.
        """
        self.done = done
        if self.bar:
            self.bar.update(self.task, completed=done, text=text)
            return
        now = time.monotonic()
        if now - self.spoke < QUIET_SECONDS:
            return
        self.spoke = now
        said = line or ", ".join(part for part in (self._told(now), text) if part)
        print(f"{self.name}: {said}", file=sys.stderr, flush=True)

    def _told(self, now: float) -> str:
        here = self.done - self.before
        count = f"{self.done:g} of {self.total:g}"
        if not here:
            return count
        left = (now - self.began) * (self.total - self.done) / here
        return f"{count}, {duration(left)} left"


def each(name: str, items: Sequence[Item]) -> Iterator[Item]:
    """Go through items under a bar.

    Args:
        name: of the work.
        items: all of them, a second of work each or more.
    """
    with Bar(name, len(items)) as bar:
        for number, item in enumerate(items, 1):
            yield item
            bar.update(number)


@contextmanager
def working(name: str) -> Iterator[Callable[[str], None]]:
    """Show that something goes on whose end is not known: what, and how long already.

    Gives a function that says what is done now. Without a terminal nothing is shown.
    """
    if not sys.stderr.isatty():
        yield lambda text: None
        return
    from rich.console import Console
    from rich.progress import Progress, SpinnerColumn, TextColumn, TimeElapsedColumn

    shown = Progress(
        SpinnerColumn(),
        TextColumn("{task.description}"),
        TimeElapsedColumn(),
        console=Console(stderr=True),
        transient=True,
    )
    with shown:
        task = shown.add_task(name, total=None)
        yield lambda text: shown.update(task, description=f"{name}: {text}")


def duration(seconds: float) -> str:
    """A time in words: ``about 2 h 10 min``."""
    if seconds == float("inf"):
        return "an unknown time"
    minutes = round(seconds / 60)
    if minutes < 2:
        return f"about {seconds:.0f} s"
    hours, minutes = divmod(minutes, 60)
    return f"about {hours} h {minutes} min" if hours else f"about {minutes} min"


def _bar(counted: bool) -> Any:
    from rich.console import Console
    from rich.progress import (
        BarColumn,
        MofNCompleteColumn,
        Progress,
        TextColumn,
        TimeElapsedColumn,
        TimeRemainingColumn,
    )
    from rich.table import Column

    count = MofNCompleteColumn() if counted else TextColumn("{task.percentage:.0f} %")
    one_line = Column(no_wrap=True, overflow="ellipsis")
    return Progress(
        TextColumn("{task.fields[name]}", markup=False),
        BarColumn(bar_width=None, table_column=Column(min_width=8, ratio=1)),
        count,
        TimeElapsedColumn(),
        TextColumn("left"),
        TimeRemainingColumn(),
        TextColumn("{task.fields[text]}", markup=False, table_column=one_line),
        console=Console(stderr=True),
        expand=True,
    )
