"""Progress on the standard error stream: a bar with an estimate, or lines.

A bar fits 80 columns and gets wider with the terminal. Without a terminal a line is
written every `QUIET_SECONDS`, so that a log stays short.
"""

import sys
import threading
import time
from collections.abc import Callable, Iterable, Iterator, Mapping, Sequence
from contextlib import contextmanager
from typing import Any, Protocol, TypeVar

Item = TypeVar("Item")

Tell = Callable[[str], None]
"""is told which stage of some work begins"""

QUIET_SECONDS = 30.0
"""time between two lines where there is no terminal [s]"""
LEFT = len("about 10 h 10 min left")
"""width of an estimate [characters]"""
NAME, TEXT = 16, 26
"""widest name and widest text of a bar on 80 columns [characters]"""


class Each(Protocol):
    """Goes through items of about as much work each, and may count them."""

    def __call__(self, items: Sequence[Item], /) -> Iterable[Item]: ...


def unheard(stage: str) -> None:
    """A `Tell` that shows nothing."""


def uncounted(items: Sequence[Item]) -> Iterable[Item]:
    """An `Each` that shows nothing."""
    return items


class Bar:
    """A bar, or lines, for work whose amount is known.

    Args:
        name: of the work.
        total: how much there is, in any unit.
        done: how much lies behind already.
        counted: show done and total as numbers.
        transient: leave nothing on the terminal once it is over.
    """

    def __init__(
        self,
        name: str,
        total: float,
        *,
        done: float = 0,
        counted: bool = True,
        transient: bool = False,
    ):
        self.name, self.total, self.done = name, total, done
        self.began = self.spoke = time.monotonic()
        self.before = done
        self.bar: Any = None
        if sys.stderr.isatty():
            self.bar = _bar(counted, transient)
            shown = name if len(name) <= NAME else f"{name[: NAME - 1]}…"
            self.task = self.bar.add_task(
                "", total=total or None, completed=done, name=shown, text=""
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

    def extend(self, more: float) -> None:
        """There is more to do than was known.

        Args:
            more: in the unit of the total.
        """
        self.total += more
        if self.bar:
            self.bar.update(self.task, total=self.total)

    def through(self, items: Sequence[Item]) -> Iterator[Item]:
        """Go through items, each of which is one of the total."""
        for item in items:
            yield item
            self.update(self.done + 1)

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
        yield from bar.through(items)


@contextmanager
def counting(name: str) -> Iterator[Each]:
    """Show how many of the items that some work goes through lie behind it.

    Gives what goes through them; several sequences, one after the other, add up.
    Without a terminal nothing is shown.

    Args:
        name: of the work.
    """
    if not sys.stderr.isatty():
        yield uncounted
        return
    with Bar(name, 0, transient=True) as bar:

        def each(items: Sequence[Item]) -> Iterator[Item]:
            bar.extend(len(items))
            yield from bar.through(items)

        yield each


class Estimate:
    """How long work of unknown length goes on, by the usual share of its stages.

    Args:
        shares: of the whole that each stage takes, in order; together 1.
        usual: what all of it takes as a rule [s]; 0 = unknown, so that there is no
            estimate before the first stage ends.
        clock: gives the time [s].
    """

    def __init__(
        self,
        shares: Mapping[str, float],
        *,
        usual: float = 0.0,
        clock: Callable[[], float] = time.monotonic,
    ):
        self.shares, self.clock = shares, clock
        self.began = clock()
        self.ends = self.began + usual if usual else None

    def enter(self, stage: str) -> None:
        """A stage begins; one without a share changes nothing.

        Args:
            stage: one of the shares.
        """
        if stage not in self.shares:
            return
        names = list(self.shares)
        behind = sum(self.shares[name] for name in names[: names.index(stage)])
        if behind > 0:
            self.ends = self.began + (self.clock() - self.began) / behind

    def __str__(self) -> str:
        if self.ends is None:
            return ""
        left = self.ends - self.clock()
        return f"{duration(left)} left" if left >= 1 else "a little longer"


@contextmanager
def working(
    name: str, shares: Mapping[str, float] | None = None, *, usual: float = 0.0
) -> Iterator[Tell]:
    """Show work of unknown length: what goes on, how long already, about how long yet.

    Gives a function that says what is done now. Without a terminal a line is written
    every `QUIET_SECONDS`.

    Args:
        name: of the work.
        shares: of the whole that its stages take as a rule, in order.
        usual: what all of it takes as a rule [s]; 0 = unknown.
    """
    estimate = Estimate(shares or {}, usual=usual)
    if not sys.stderr.isatty():
        with _in_lines(name, estimate) as tell:
            yield tell
        return
    shown = _spinner(estimate)
    with shown:
        task = shown.add_task(name, total=None)

        def tell(stage: str) -> None:
            estimate.enter(stage)
            shown.update(task, description=f"{name}: {stage}")

        yield tell


@contextmanager
def _in_lines(name: str, estimate: Estimate) -> Iterator[Tell]:
    """The same in lines, by a thread that ends with the work."""
    over, began, now = threading.Event(), time.monotonic(), ""

    def speak() -> None:
        while not over.wait(QUIET_SECONDS):
            spent = f"{time.monotonic() - began:.0f} s"
            said = ", ".join(filter(None, (now, spent, str(estimate))))
            print(f"{name}: {said}", file=sys.stderr, flush=True)

    def tell(stage: str) -> None:
        nonlocal now
        estimate.enter(stage)
        now = stage

    speaker = threading.Thread(target=speak, daemon=True)
    speaker.start()
    try:
        yield tell
    finally:
        over.set()
        speaker.join()


def duration(seconds: float) -> str:
    """A time in words: ``about 2 h 10 min``."""
    if seconds == float("inf"):
        return "an unknown time"
    minutes = round(seconds / 60)
    if minutes < 2:
        return f"about {seconds:.0f} s"
    hours, minutes = divmod(minutes, 60)
    return f"about {hours} h {minutes} min" if hours else f"about {minutes} min"


def _spinner(estimate: Estimate) -> Any:
    """A line whose last column is the estimate, as long as that is shown."""
    from rich.console import Console
    from rich.progress import (
        Progress,
        ProgressColumn,
        SpinnerColumn,
        Task,
        TextColumn,
        TimeElapsedColumn,
    )
    from rich.table import Column
    from rich.text import Text

    class Left(ProgressColumn):
        def render(self, task: Task) -> Text:
            return Text(str(estimate))

    console = Console(stderr=True)
    room = max(console.width - LEFT - len("- 10:00:00 "), NAME)
    one_line = Column(no_wrap=True, overflow="ellipsis", max_width=room)
    return Progress(
        SpinnerColumn(),
        TextColumn("{task.description}", markup=False, table_column=one_line),
        TimeElapsedColumn(),
        Left(Column(no_wrap=True)),
        console=console,
        transient=True,
    )


def _bar(counted: bool, transient: bool) -> Any:
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
        transient=transient,
    )
