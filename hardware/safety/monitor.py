"""Looking at a robot between two orders, with an eye on what can go wrong."""

from abc import ABC, abstractmethod

from bns.errors import BnsError
from bns.hardware.clock import Clock
from bns.hardware.faults import FaultLog, SafetyStop, Void
from bns.hardware.safety.limits import Limits, Operator
from bns.hardware.tracking.eyes import Eyes
from bns.hardware.tracking.tracker import Sighting

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
