"""What may happen to a robot that is driven, and from when on it could be stopped."""

import os
import signal
import threading
import time
from collections.abc import Callable
from pathlib import Path
from typing import NamedTuple

from bench.hardware.drives import Driver, Log
from bns.errors import BnsError

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
