"""What a robot on the board may do, who may stop it, and who looks that it is so."""

import contextlib
import math
import select
import signal
import sys
from abc import ABC, abstractmethod
from dataclasses import dataclass
from types import FrameType

from bns.errors import BnsError
from bns.hardware.clock import Clock
from bns.hardware.faults import FaultLog, SafetyStop, Void
from bns.hardware.tracking.eyes import Eyes
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


SIGHT = 3.0  # s to wait for the standing robot to be seen
AHEAD = 0.05  # s by which a time stamp may be ahead of the clock


class SafetyMonitor(ABC):
    """Who moves a robot under the limits, as far as seeing it goes.

    Args:
        eyes: that see it.
        clock: of the session.
        limits: hold at every look.
        operator: may stop it at any time.
        faults: where faults are noted.

    Attributes:
        last: newest sighting.
    """

    def __init__(
        self,
        eyes: Eyes,
        clock: Clock,
        *,
        limits: Limits,
        operator: Operator,
        faults: FaultLog,
    ):
        self.eyes, self.clock = eyes, clock
        self.limits, self.operator, self.faults = limits, operator, faults
        self.last: Sighting | None = None

    @abstractmethod
    def look(self) -> list[Sighting]:
        """New sightings; with the safety checks of a tick.

        Raises:
            SafetyStop: the operator or the camera.
            Void: it was not seen for too long, or not seen to move.
        """

    @abstractmethod
    def tick(self) -> None:
        """Let the time between two looks pass."""

    def wait_for_sight(self, seconds: float = SIGHT) -> Sighting:
        """A fresh sighting.

        Raises:
            BnsError: the tag is not in view.
        """
        begin = self.clock.now()
        while self.clock.now() - begin < seconds:
            for sighting in self.look():
                if sighting.time >= begin:
                    return sighting
            self.tick()
        raise BnsError(
            "The robot's tag is not in view: put the robot on the board, free the "
            "camera's view, light it evenly."
        )

    def _seen(self, *, moving: bool) -> list[Sighting]:
        """New sightings; a robot that moves must have been seen of late.

        Pictures that cannot be of now are left out: repeated ones, and those with a
        time stamp ahead of the clock.

        Raises:
            SafetyStop: the operator says so, the camera is gone, a lamp is near.
            Void: it was not seen for too long; the caller stops it.
        """
        self.operator.check()
        try:
            seen = self.eyes.poll()
        except BnsError as error:
            raise SafetyStop(f"the camera is lost ({error})", "check it") from error
        latest = self.clock.now() + AHEAD
        seen = [s for s in seen if s.time <= latest and not s.repeated]
        if seen:
            self.last = seen[-1]
        if moving and (self.last is None or self._since(self.last) > self.limits.blind):
            self.faults.note("not seen", "tag", f"{self.limits.blind:g} s")
            raise Void(f"it was not seen for {self.limits.blind:g} s while it moved")
        if moving and any(map(self.limits.at_lamp, seen)):
            raise SafetyStop(
                f"it came within {self.limits.lamp:g} m of a lamp",
                "see that the lamps stand where the configuration says",
            )
        return seen

    def _since(self, sighting: Sighting) -> float:
        return self.clock.now() - sighting.time
