"""Precedence over other programs, for what has to answer a robot in time."""

import contextlib
import os
import threading

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
