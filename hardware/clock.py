"""Time, the machine's own or a virtual one, and precedence over other programs."""

import contextlib
import os
import threading
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
    """Time that passes only when something waits: exact, and faster than real."""

    def __init__(self) -> None:
        self._now = 0.0  # s

    def now(self) -> float:
        """Virtual time [s]."""
        return self._now

    def sleep(self, seconds: float) -> None:
        """Advance [s]."""
        self._now += max(seconds, 0.0)


URGENT = -10  # nice value where the real-time class is not to be had
LEVEL = 5  # of the real-time class, 1 to 99


def urgent() -> str:
    """Give this thread precedence where the system allows it; says which kind.

    The real-time class ("real time") lets it run at once when something happens, a
    nice value ("nice") soon, else it waits its turn ("none"). Both need a privilege
    (`ulimit -r`, `ulimit -e`). Threads and processes started later do not inherit the
    real-time class.
    """
    with contextlib.suppress(OSError, AttributeError):
        os.sched_setscheduler(
            0, os.SCHED_RR | os.SCHED_RESET_ON_FORK, os.sched_param(LEVEL)
        )
        return "real time"
    with contextlib.suppress(OSError, AttributeError):
        os.setpriority(os.PRIO_PROCESS, threading.get_native_id(), URGENT)
        return "nice"
    return "none"
