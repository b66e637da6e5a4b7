"""What a robot on the board may do, and who may stop it."""

import contextlib
import math
import select
import signal
import sys
from dataclasses import dataclass
from types import FrameType

from bns.hardware.faults import SafetyStop
from bns.hardware.tracking.tracker import Sighting
from bns.worlds import world

SIGNALS = ("SIGINT", "SIGTERM", "SIGHUP")


@dataclass(frozen=True, kw_only=True)
class Limits:
    """Bounds of a session; the driver and the loop hold them, nothing turns them off.

    Attributes:
        speed: of a wheel over the floor [m/s].
        arena: size of the board [m], its centre the origin.
        rim: kept free along its edge while a trial goes on [m].
        blind: greatest age of the newest sighting while the robot moves [s].
        battery: lowest voltage to start a trial with [V] (two LiPo cells; assumed).
        lamps: where lamps stand on the board [m].
        lamp: a moving robot whose centre is nearer to a lamp is stopped, whatever it
            does [m]: its radius is 0.067; the margin is assumed.
    """

    speed: float = 0.15
    arena: tuple[float, float] = (2.7, 1.8)
    rim: float = 0.10
    blind: float = 0.15
    battery: float = 7.0
    lamps: tuple[tuple[float, float], ...] = ()
    lamp: float = 0.08

    def outside(self, sighting: Sighting, rim: float) -> bool:
        """Whether the robot is nearer to the edge than `rim` [m]."""
        x, y = sighting.pose[:2]
        half = self.arena[0] / 2 - rim, self.arena[1] / 2 - rim
        return bool(abs(x) > half[0] or abs(y) > half[1])

    def at_lamp(self, sighting: Sighting) -> bool:
        """Whether the robot is nearer to a lamp than it may be."""
        x, y = sighting.pose[:2]
        return any(math.hypot(x - u, y - v) < self.lamp for u, v in self.lamps)


class Operator:
    """The person at the keyboard, signals, and the alarm: any of them stops the robot.

    Inside the `with` block SIGINT, SIGTERM and SIGHUP are noted instead of obeyed
    (the robot is stopped first) where this is the main thread; on a terminal the
    space bar or Enter does the same.
    """

    def __init__(self) -> None:
        self.reason = ""
        self._before: dict[int, object] = {}

    def __enter__(self) -> "Operator":
        with contextlib.suppress(ValueError):  # not the main thread
            for name in SIGNALS:
                number = getattr(signal, name)
                self._before[number] = signal.signal(number, self._note)
        return self

    def __exit__(self, *_: object) -> None:
        for number, handler in self._before.items():
            signal.signal(number, handler)  # type: ignore[arg-type]
        self._before.clear()

    def _note(self, number: int, frame: FrameType | None) -> None:
        self.reason = (
            self.reason or f"the operator said so ({signal.Signals(number).name})"
        )

    def check(self) -> None:
        """Raise where somebody wants the robot to stop.

        Raises:
            SafetyStop: somebody does.
        """
        if world.reason():
            raise SafetyStop(world.reason(), "nothing is lost up to the last trial")
        if not self.reason and _key():
            self.reason = "the operator said so (key)"
        if self.reason:
            raise SafetyStop(self.reason, "go on with --resume")


def _key() -> bool:
    """Whether a line was entered on a terminal that this process may read."""
    if not (sys.stdin and sys.stdin.isatty()):
        return False
    import os

    if os.getpgrp() != os.tcgetpgrp(sys.stdin.fileno()):
        return False
    if not select.select([sys.stdin], [], [], 0)[0]:
        return False
    sys.stdin.readline()
    return True
