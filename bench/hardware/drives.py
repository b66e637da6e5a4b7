"""Robots on the move, for the bench that stops them: what drives, what the log says."""

import json
import subprocess
import sys
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

HEAD = """
import sys, threading
from bns.hardware.priority import urgent
urgent()
from bns.worlds import alarm
from bns.worlds.trial import Channel, Commands
def fail():
    sys.stdin.readline()
    alarm.ring("the learner failed")
threading.Thread(target=fail, daemon=True).start()
def begin(world, look):
    rig = world.connected()
    x, y, yaw = look(rig).wait_for_sight().pose
    world.start = (x, y, yaw) if max(abs(x), abs(y)) < 0.4 else (0.0, 0.0, yaw)
    print("watchdog", rig.watchdog.pid, flush=True)
    return rig
"""
KHEPERA = """
from bns.hardware.world import HardwareWorld
world = HardwareWorld(port=sys.argv[1])
begin(world, lambda rig: rig.mover())
try:
    world.run([Commands([[0.04, 0.10]], [25.0])])
finally:
    world.close()
"""
HEXAPOD = """
import numpy as np
from bns.hardware.hexapod_world import HardwareHexapod
world = HardwareHexapod(port=sys.argv[1])
walker = begin(world, lambda rig: rig.walker).walker
perform = walker.perform
def performed(*words):
    print("moving", flush=True)
    return perform(*words)
walker.perform = performed
names = tuple(Channel(*channel) for channel in world.model.channels)
goals = np.zeros((40, 18))
goals[::2, 1::3] = 0.3
try:
    world.run([Commands(goals, np.full(40, 2.0), names)])
finally:
    world.close()
"""
DRIVEN = [5760, 14401]  # speed units of 0.04 and 0.10 m/s, firmware 2


class Log:
    """What an emulated robot has noted, read as it grows.

    Args:
        path: file of JSON lines.
    """

    def __init__(self, path: Path) -> None:
        self.path, self._rows, self._read = path, [], 0

    def rows(self) -> list[dict]:
        """All rows so far."""
        if self.path.exists():
            with open(self.path, encoding="utf-8") as file:
                file.seek(self._read)
                for line in iter(file.readline, ""):
                    if not line.endswith("\n"):
                        break
                    self._rows.append(json.loads(line))
                    self._read += len(line)
        return self._rows

    def newest(self, key: str, begin: float, end: float) -> dict:
        """The newest row with a key between two times, empty if there is none."""
        rows = reversed(self.rows())
        return next((r for r in rows if key in r and begin < r["at"] <= end), {})

    def first(self, key: str, at: float) -> float | None:
        """When something was first so from a time on [s]; None: never."""
        return next(
            (r["at"] for r in self.rows() if r.get(key) and r["at"] >= at), None
        )


class Driver:
    """A process that drives an emulated robot.

    Args:
        script: what it does.
        port: of the robot.
        env: its environment.
    """

    def __init__(self, script: str, port: Path, env: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-c", script, str(port)],
            stdin=subprocess.PIPE,
            stdout=subprocess.PIPE,
            stderr=subprocess.PIPE,
            text=True,
            env=env,
        )
        self.said: list[tuple[float, str]] = []
        self.began = time.monotonic()
        for stream in (self.process.stdout, self.process.stderr):
            threading.Thread(target=self._listen, args=(stream,), daemon=True).start()

    def _listen(self, stream) -> None:
        for line in stream:
            self.said.append((time.monotonic(), line.strip()))

    @property
    def watchdog(self) -> int:
        """Number of its watchdog's process, 0 while there is none."""
        words = [text.split() for _, text in self.said if text.startswith("watchdog ")]
        return int(words[-1][1]) if words else 0

    def moving(self) -> float | None:
        """When it said that the trial began."""
        return next((at for at, text in self.said if text == "moving"), None)


class Drive(NamedTuple):
    """A robot that is driven, and how its log is read.

    Attributes:
        robot: its name.
        script: drives it.
        steady: whether a drive has gone on for a moment.
        driven: whether the robot was driven at a time.
    """

    robot: str
    script: str
    steady: Callable[[Log, Driver], bool]
    driven: Callable[[Log, float], bool]


def _rolling(log: Log, driver: Driver) -> bool:
    now = time.monotonic()
    row = log.newest("told", driver.began, now)
    return row.get("told") == DRIVEN and now - row["at"] > 0.7


def _rolled(log: Log, at: float) -> bool:
    return log.newest("told", 0.0, at).get("told") == DRIVEN


def _walking(log: Log, driver: Driver) -> bool:
    since = driver.moving()
    return since is not None and time.monotonic() - since > 1.0


def _walked(log: Log, at: float) -> bool:
    row = log.newest("powered", 0.0, at)
    return row.get("powered", 0) > 0 and not log.newest("stop", row["at"], at)


DRIVES = (
    Drive("khepera3", HEAD + KHEPERA, _rolling, _rolled),
    Drive("phantomx", HEAD + HEXAPOD, _walking, _walked),
)
