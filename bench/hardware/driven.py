"""A process that drives an emulated robot until something stops it.

    python -m bench.hardware.driven ROBOT PORT

It says `watchdog NUMBER` once it has one; a line on its standard input makes its
learner fail.
"""

import sys
import threading
from collections.abc import Callable, Sequence

import numpy as np

from bns.hardware.clock import urgent
from bns.hardware.dynamixel.walker import Walked
from bns.hardware.safety.monitor import SafetyMonitor
from bns.hardware.worlds.hexapod import HardwareHexapod
from bns.hardware.worlds.wheeled import HardwareWorld
from bns.worlds.trial import Channel, Commands
from bns.worlds.world import ring

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

if __name__ == "__main__":
    urgent()
    threading.Thread(target=_fail, daemon=True).start()
    DRIVERS[sys.argv[1]](sys.argv[2])
