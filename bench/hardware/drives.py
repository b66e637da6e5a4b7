"""Robots on the move, for the bench that stops them, and what may happen to them.

What drives a robot until something stops it is a process of its own:

    python -m bench.hardware.drives ROBOT PORT

It says `watchdog NUMBER` once it has one; a line on its standard input makes its
learner fail.
"""

import json
import os
import signal
import subprocess
import sys
import threading
import time
from collections.abc import Callable, Sequence
from pathlib import Path
from typing import NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.hardware.clock import urgent
from bns.hardware.dynamixel.walker import Walked
from bns.hardware.safety.limits import SafetyMonitor
from bns.hardware.worlds.hexapod import HardwareHexapod
from bns.hardware.worlds.wheeled import HardwareWorld
from bns.worlds.trial import Channel, Commands
from bns.worlds.world import ring

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
        robot: its name.
        port: of the robot.
        env: its environment.
    """

    def __init__(self, robot: str, port: Path, env: dict[str, str]) -> None:
        self.process = subprocess.Popen(
            [sys.executable, "-m", "bench.hardware.drives", robot, str(port)],
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
        cycle: time within which its motion repeats, or all phases of loops [s].
        steady: whether a drive has gone on for a moment.
        driven: whether the robot was driven at a time.
    """

    robot: str
    cycle: float
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
    Drive("khepera3", 0.2, _rolling, _rolled),
    Drive("phantomx", 1.2, _walking, _walked),
)


SPEEDS, LASTS = (0.04, 0.10), 25.0  # m/s of the left and right wheel; s
NEAR = 0.4  # m from the middle at which a drive may begin where the robot is


def khepera3(port: str) -> None:
    """Drive a curve."""
    world = HardwareWorld(port=port)
    try:
        rig = world.connected()
        _ready(world, rig.watchdog.pid, rig.mover())
        world.run([Commands([list(SPEEDS)], [LASTS])])
    finally:
        world.close()


def phantomx(port: str) -> None:
    """Tread on the spot; says `moving` when that begins."""
    world = HardwareHexapod(port=port)
    try:
        rig = world.connected()
        _ready(world, rig.watchdog.pid, rig.walker)
        rig.walker.perform = _told(rig.walker.perform)
        names = tuple(Channel(*channel) for channel in world.model.channels)
        world.run([Commands(treading(), np.full(40, 2.0), names)])
    finally:
        world.close()


def treading() -> np.ndarray:
    """Goals that raise all thighs and lower them, ``(40, 18)`` [rad]."""
    goals = np.zeros((40, 18))
    goals[::2, 1::3] = 0.3
    return goals


def _told(perform: Callable[..., Walked]) -> Callable[..., Walked]:
    def performed(goals: np.ndarray, limits: Sequence[float]) -> Walked:
        print("moving", flush=True)
        return perform(goals, limits)

    return performed


def _ready(
    world: HardwareWorld | HardwareHexapod, watchdog: int, looks: SafetyMonitor
) -> None:
    """Begin where the robot is, if it is near the middle."""
    x, y, yaw = looks.wait_for_sight().pose
    world.start = (x, y, yaw) if max(abs(x), abs(y)) < NEAR else (0.0, 0.0, yaw)
    print("watchdog", watchdog, flush=True)


def _fail() -> None:
    sys.stdin.readline()
    ring("the learner failed")


DRIVERS = {"khepera3": khepera3, "phantomx": phantomx}


CLOCK = """
import os, time
def moved(real, unit):
    def now():
        with open(os.environ["BENCH_CLOCK"]) as file:
            return real() + unit * int(file.read() or 0)
    return now
time.time, time.time_ns = moved(time.time, 1), moved(time.time_ns, 10**9)
"""
"""`sitecustomize` of a process whose wall clock is set by a file, in seconds"""
LATER = 0.3  # s after which a driver hangs whom something must not have troubled
GRACE = 0.25  # s that a driver has to notice a watchdog that hangs, before it is killed


class Scene(NamedTuple):
    """A robot that is driven.

    Attributes:
        driver: drives it.
        port: of the robot; its mishaps are beside it.
        log: of the robot.
        clock: file by which the driver's wall clock is set.
    """

    driver: Driver
    port: Path
    log: Log
    clock: Path

    def mishap(self, word: str) -> float:
        """Let it begin or end; gives the moment before [s]."""
        at = time.monotonic()
        with open(f"{self.port}.mishaps", "w") as pipe:
            pipe.write(word + "\n")
        return at

    def signal(self, number: int, *, watchdog: bool = False) -> float:
        """Send a signal to the driver or its watchdog; gives the moment before [s]."""
        at = time.monotonic()
        os.kill(self.driver.watchdog if watchdog else self.driver.process.pid, number)
        return at


def _signalled(number: int) -> Callable[[Scene], float]:
    return lambda scene: scene.signal(number)


def _mishap(word: str) -> Callable[[Scene], float]:
    return lambda scene: scene.mishap(word)


def _learner(scene: Scene) -> float:
    at = time.monotonic()
    scene.driver.process.stdin.write("now\n")
    scene.driver.process.stdin.flush()
    return at


def _dog_hung_then_killed(scene: Scene) -> float:
    at = scene.signal(signal.SIGSTOP, watchdog=True)
    time.sleep(GRACE)
    scene.signal(signal.SIGKILL)
    return at


def _cable(scene: Scene) -> float:
    scene.mishap("cable")
    time.sleep(1.0)
    return scene.mishap("cable")


def _hears(scene: Scene, begin: float) -> float:
    """When a robot that starts anew hears again [s]."""
    # a row has the time at which the robot's round began, a moment earlier
    while not (row := scene.log.newest("hears", begin - 0.5, time.monotonic())):
        if time.monotonic() > begin + 10:
            raise BnsError("The emulated robot does not start anew.")
        time.sleep(0.01)
    return row["hears"]


def _reset(scene: Scene) -> float:
    """Time counts from when the robot hears again."""
    return _hears(scene, scene.mishap("reset"))


def _power(scene: Scene) -> float:
    """Time counts from when the robot hears again."""
    scene.mishap("power")
    time.sleep(0.5)
    return _hears(scene, scene.mishap("power"))


def _flood_and(number: int) -> Callable[[Scene], float]:
    def happen(scene: Scene) -> float:
        begin = scene.mishap("flood")
        time.sleep(0.01)
        at = scene.signal(number)
        time.sleep(0.02)
        stopped = scene.log.first("stop", begin)
        return begin if stopped is not None and stopped < at else at

    return happen


def _opened(scene: Scene) -> float:
    """Somebody else reads the port; if the driver bears it, it hangs later."""
    at = time.monotonic()
    number = os.open(scene.port, os.O_RDWR | os.O_NOCTTY | os.O_NONBLOCK)
    until = at + LATER + 0.3

    def steal() -> None:
        while time.monotonic() < until:
            try:
                os.read(number, 4096)
            except OSError:
                time.sleep(0.001)
        os.close(number)

    threading.Thread(target=steal, daemon=True).start()
    time.sleep(LATER)
    if scene.log.first("stop", at) is not None:
        return at
    return scene.signal(signal.SIGSTOP)


def _clock(seconds: int) -> Callable[[Scene], float]:
    def happen(scene: Scene) -> float:
        scene.clock.write_text(str(seconds))
        time.sleep(LATER)
        return scene.signal(signal.SIGSTOP)

    return happen


WAYS: dict[str, Callable[[Scene], float]] = {
    "driver hung": _signalled(signal.SIGSTOP),
    "watchdog killed": lambda scene: scene.signal(signal.SIGKILL, watchdog=True),
    "watchdog hung": lambda scene: scene.signal(signal.SIGSTOP, watchdog=True),
    "watchdog hung, then driver killed": _dog_hung_then_killed,
    "camera covered": _mishap("covered"),
    "picture frozen": _mishap("frozen"),
    "picture stuck, noise fresh": _mishap("stuck"),
    "time stamps stale": _mishap("stale"),
    "flood": _mishap("flood"),
    "flood, driver killed": _flood_and(signal.SIGKILL),
    "flood, driver hung": _flood_and(signal.SIGSTOP),
    "interrupted": _signalled(signal.SIGINT),
    "terminated": _signalled(signal.SIGTERM),
    "driver killed": _signalled(signal.SIGKILL),
    "learner failed": _learner,
    "cable out for 1 s": _cable,
    "firmware reset": _reset,
    "power lost for 0.5 s": _power,
    "port opened by another, driver hung": _opened,
    "clock back an hour, driver hung": _clock(-3600),
    "clock on an hour, driver hung": _clock(3600),
}
"""name -> lets it happen, and gives the moment from which time counts [s]"""
QUICK = ("driver hung", "watchdog killed", "camera covered", "picture frozen", "flood")
WHEELED = ("picture stuck, noise fresh",)
"""ways for robots on wheels: how a hexapod moves does not follow from a command"""


if __name__ == "__main__":
    urgent()
    threading.Thread(target=_fail, daemon=True).start()
    DRIVERS[sys.argv[1]](sys.argv[2])
