"""Whether the wheels do as they were told, read while a robot drives.

A digit that is lost on the line is acknowledged like any other number, so a set point
is believed once the speeds have shown it. The wheels lag: after a change their speeds
lie between where they were and where they go, and how far on their way is known within
a factor; what lies outside is a wrong set point, and it is sent again.
"""

from typing import TYPE_CHECKING

import numpy as np

from bns.hardware.khepera.driver import Drive

if TYPE_CHECKING:
    from bns.hardware.motion import Mover

CHECK = 0.12  # s between two looks
ROOM = 0.06  # s before the next set point in which nothing is asked
LAGS = (0.04, 0.13, 0.28)  # s, time constant of the wheels: least, usual, most; assumed
SLACK, SHARE = 900, 0.06  # speed units, share: what wheels may be off a set point
TRIES = 4  # of the same set point, after which the wheel is to blame and not the line
SETTLED = 0.25  # s after which a set point that was sent again shows in the speeds


class Wheels:
    """Reads the speeds, sends wrong set points again, adds up what each did.

    A wheel that stays off although its set point was sent `TRIES` times is like that: a
    damaged robot, and no fault of the line.

    Args:
        mover: whose robot it is.

    Attributes:
        astray: way by which a wrong or mistimed set point may have led a wheel, before
            the next one was due; the worst of them [m].
        stubborn: a wheel does not follow its set point.
    """

    def __init__(self, mover: "Mover"):
        self.mover, self.astray, self.stubborn = mover, 0.0, mover.stubborn
        now = mover.clock.now()
        self._since = self._good = self._next = now
        self._units = np.zeros(2)
        self._low, self._high, self._from = np.zeros(2), np.zeros(2), np.zeros(2)
        self._seen, self._sure = np.zeros(2), False
        self._doubt, self._tries, self._way = 0.0, 0, 0.0

    def switched(self, drive: Drive) -> None:
        """A new set point holds."""
        self._blame(self._doubt * (not self.stubborn))
        self._way = 0.0
        now, told = drive.at, np.array(drive.units, float)
        jump = float(np.abs(told - self._units).max())
        usual = 3 * min(self.mover.robot.round_trips[-20:])
        if drive.took > usual:  # repeated: either of them may have got through
            self._blame(drive.took / 2 * self._metres(jump))
        self._low, self._high, self._from = self._expected(now)
        self._units, self._since, self._good = told, now, now
        self._doubt, self._tries = 0.0, 0
        self._next = now + CHECK

    def look(self, left: float) -> None:
        """Read the speeds where it is time and nothing else is due soon.

        Args:
            left: time until the next set point [s].
        """
        now = self.mover.clock.now()
        if now < self._next or left < ROOM or self.stubborn:
            return
        self._next = now + CHECK
        off = min(self._off(), self._off())  # a digit may be lost in an answer as well
        if not off:
            self._blame(self._doubt)  # sending it again has helped: it was wrong
            self._doubt, self._tries = 0.0, 0
            if self._sure:
                self._good = self.mover.clock.now()
        elif self._tries >= TRIES:
            self.stubborn = self.mover.stubborn = True
            self._doubt = 0.0
        else:
            self._again(off)

    def _again(self, off: float) -> None:
        """Send the set point again; the one in force seems to be off [units]."""
        mover, last = self.mover, self.mover.points[-1]
        mover.faults.note("wheels not as told", str(last.units), f"{off:.0f}")
        sizes = zip(last.units, mover.robot.wheels, strict=True)
        again = mover.robot.drive(*(self._metres(u) * f for u, f in sizes), times=2)
        self._doubt += self._metres(off) * (again.at - self._good)
        seen = self._seen
        self._low, self._high, self._from = seen - SLACK, seen + SLACK, seen
        self._since = self._good = again.at
        self._tries += 1
        self._next = again.at + SETTLED

    def _expected(self, now: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lowest, highest and usual speeds at a time [units]."""
        kept = np.exp(-(now - self._since) / np.array(LAGS))
        ends = np.stack([self._low, self._high, self._from])
        ways = self._units + (ends - self._units) * kept[:, None, None]
        return ways.min((0, 1)), ways.max((0, 1)), ways[1, 2]

    def _off(self) -> float:
        """By how much a set point seems to be wrong [units], 0 where none does."""
        seen = np.array(self.mover.robot.speeds(), float)
        now = self.mover.clock.now()
        low, high, usual = self._expected(now)
        slack = SLACK + SHARE * np.abs(self._units).max()
        self._seen, self._sure = seen, (high - low).max() < SLACK
        if ((seen >= low - slack) & (seen <= high + slack)).all():
            return 0.0
        shown = 1 - np.exp(-(now - self._since) / LAGS[1])
        return float(np.abs(seen - usual).max() / max(shown, 0.2))

    def _blame(self, way: float) -> None:
        """Add to what the set point in force did wrong [m]."""
        self._way += float(way)
        self.astray = max(self.astray, self._way)

    def _metres(self, units: float) -> float:
        return self.mover.robot.units.speed(units)
