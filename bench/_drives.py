"""Robots on the move, for the bench that stops them: what drives, what the log says."""

import time
from collections.abc import Callable
from typing import NamedTuple

HEAD = """
import sys
from bns.hardware.priority import urgent
urgent()
from bns.worlds import alarm
from bns.worlds.trial import Channel, Commands
def ready(world):
    world.connected()
    if sys.argv[2] == "learner":
        import threading, time
        def fail():
            sys.stdin.readline()
            print("now", time.monotonic(), flush=True)
            alarm.ring("the learner failed")
        threading.Thread(target=fail, daemon=True).start()
    print("ready", flush=True)
"""
KHEPERA = """
from bns.hardware.world import HardwareWorld
world = HardwareWorld(port=sys.argv[1], start=(-0.9, 0.0, 0.0))
ready(world)
world.run([Commands([[0.06, 0.07]], [25.0])])
"""
HEXAPOD = """
import numpy as np
from bns.hardware.hexapod_world import HardwareHexapod
world = HardwareHexapod(port=sys.argv[1])
ready(world)
names = tuple(Channel(*channel) for channel in world.model.channels)
goals = np.zeros((40, 18))
goals[::2, 1::3] = 0.3
world.run([Commands(goals, np.full(40, 2.0), names)])
"""
DRIVEN = [8641, 10081]  # speed units of 0.06 and 0.07 m/s, firmware 2


class Drive(NamedTuple):
    """A robot that is driven, and how its log is read.

    Attributes:
        robot: its name.
        words: more for `bns hardware emulate`.
        script: drives it.
        steady: whether a drive that began at a time has gone on for a moment.
        driven: whether it was still driven at a time.
        times: moments of the stop by name, after a time.
        ended: whether there is nothing more to wait for.
    """

    robot: str
    words: tuple[str, ...]
    script: str
    steady: Callable[[list, float], bool]
    driven: Callable[[list, float], bool]
    times: Callable[[list, float], dict]
    ended: Callable[[list, float], bool]


def _last(rows: list, key: str, begin: float, end: float) -> dict:
    """The newest row with a key between two times, empty if there is none."""
    return next((r for r in reversed(rows) if key in r and begin < r["at"] < end), {})


def _rolling(rows: list, begin: float) -> bool:
    now = time.monotonic()
    row = _last(rows, "told", begin, now)
    return row.get("told") == DRIVEN and now - row["at"] > 0.7


def _wheels(rows: list, at: float) -> dict:
    later = [row for row in rows if row["at"] >= at]
    return {
        "told": [row["at"] for row in later if row.get("told") == [0, 0]],
        "stands": [row["at"] for row in later if row.get("stands")],
    }


def _walking(rows: list, begin: float) -> bool:
    now = time.monotonic()
    row = _last(rows, "powered", begin, now)
    return row.get("powered") == 18 and now - row["at"] > 8.0  # up, and at the start


def _servos(rows: list, at: float) -> dict:
    return {"told": [r["at"] for r in rows if r.get("powered") == 0 and r["at"] >= at]}


DRIVES = (
    Drive(
        "khepera3",
        ("--start", "-0.9", "0", "0"),
        HEAD + KHEPERA,
        _rolling,
        lambda rows, at: _last(rows, "told", 0.0, at).get("told") == DRIVEN,
        _wheels,
        lambda rows, at: bool(_wheels(rows, at)["stands"]),
    ),
    Drive(
        "phantomx",
        (),
        HEAD + HEXAPOD,
        _walking,
        lambda rows, at: _last(rows, "powered", 0.0, at).get("powered", 0) > 0,
        _servos,
        lambda rows, at: bool(_servos(rows, at)["told"]),
    ),
)
