"""Time: the machine's own, or a virtual one that rehearsals advance."""

import time
from typing import Protocol


class Clock(Protocol):
    """Where drivers and worlds take their time from."""

    def now(self) -> float:
        """Monotonic time [s]."""
        ...

    def sleep(self, seconds: float) -> None:
        """Let that much time pass [s]."""
        ...


class RealClock:
    """The machine's monotonic clock."""

    def now(self) -> float:
        """Monotonic time [s]."""
        return time.monotonic()

    def sleep(self, seconds: float) -> None:
        """Wait [s]."""
        if seconds > 0:
            time.sleep(seconds)


class VirtualClock:
    """Time that passes only when something waits: exact, and faster than real.

    Args:
        start: time at the beginning [s].
    """

    def __init__(self, start: float = 0.0):
        self._now = start

    def now(self) -> float:
        """Virtual time [s]."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance [s]."""
        self._now += max(seconds, 0.0)
