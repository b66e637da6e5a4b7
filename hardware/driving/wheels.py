"""Whether the wheels do as they were told, read while a robot drives.

A digit that is lost on the line is acknowledged like any other number, so a set point
is believed once the speeds have shown it. The wheels lag: after a change their speeds
lie between where they were and where they go, and how far on their way is known within
a factor; what lies outside is a wrong set point, and it is sent again. A wheel that
goes on missing its set points by a share is a damaged one: its share is learned. And on
a line that spoils no answers it is not the line that spoils set points.
"""

from dataclasses import dataclass, field
from typing import TYPE_CHECKING

import numpy as np

from bns.hardware.khepera.driver import Drive

if TYPE_CHECKING:
    from bns.hardware.driving.motion import Mover

CHECK = 0.12  # s between two looks
ROOM = 0.06  # s before the next set point in which nothing is asked
LAGS = (0.04, 0.13, 0.28)  # s, wheels' time constant: the model's, bounds assumed
SLACK, SHARE = 900, 0.06  # speed units, share: what wheels may be off a set point
FAST = 8000  # speed units; slower, a share that is missing may not show
TRIES = 3  # sent again in vain, after which the wheel is to blame and not the line
LEARNED = 3  # times that a share is learned; after that the wheel follows no rule
SPARE = 3  # set points sent again, beyond those that a spoilt line explains
UNTOLD, SPOILT = "wheels not as told", ("no answer", "garbled answer", "cut answer")
SETTLED = 0.25  # s after which a set point that was sent again shows in the speeds


@dataclass
class Following:
    """How the wheels of a robot follow, kept over a session.

    Attributes:
        shares: of its set point that each wheel reaches, ``(2,)``.
        tries: how often the set point in force was sent again in vain, by wheel.
        learned: how often a share was learned.
    """

    shares: np.ndarray = field(default_factory=lambda: np.ones(2))
    tries: np.ndarray = field(default_factory=lambda: np.zeros(2, int))
    learned: int = 0

    @property
    def lawless(self) -> bool:
        """Whether a wheel follows no rule; nothing is sent again any more."""
        return self.learned > LEARNED


class Wheels:
    """Reads the speeds, sends wrong set points again, adds up what they did.

    Args:
        mover: whose robot it is.

    Attributes:
        astray: way by which a wrong or mistimed set point may have led a wheel, before
            the next one was due; the worst of them [m].
        odd: a wheel did not follow, and its share was learned anew.
    """

    def __init__(self, mover: "Mover"):
        self.mover, self.follow = mover, mover.following
        self.astray, self.odd = 0.0, False
        self._since = self._good = self._next = mover.clock.now()
        self._told, self._seen = np.zeros(2), np.zeros(2)
        self._low, self._high, self._from = np.zeros(2), np.zeros(2), np.zeros(2)
        self._doubt, self._way, self._open = 0.0, 0.0, 0.0

    def switched(self, drive: Drive) -> None:
        """A new set point holds."""
        self._open = max(self._open, self._way + self._doubt)
        self._doubt = self._way = 0.0
        self.follow.tries[:] = 0
        now, told = drive.at, np.array(drive.units, float)
        jump = float(np.abs(told - self._told).max())
        self._way += self.mover.doubt(drive) * self._metres(jump)
        self._low, self._high, self._from = self._expected(now)
        self._told, self._since, self._good = told, now, now
        self._next = now + CHECK

    def look(self, left: float) -> None:
        """Read the speeds where it is time and nothing else is due soon.

        Args:
            left: time until the next set point [s].
        """
        now = self.mover.clock.now()
        if now < self._next or left < ROOM:
            return
        self._next = now + CHECK
        off = self._off()  # shows as well that the line lives
        if self.follow.lawless:
            return
        if off.any():  # an answer may have lost a digit
            off = np.minimum(off, self._off())
        if off.any():
            self._wrong(off)
            return
        if not self._sure:
            return
        if self._doubt:  # sending it again has helped: it was wrong
            self.follow.tries[:] = 0
            self._way += self._doubt
            self._doubt = 0.0
        self._good = self.mover.clock.now()

    def end(self) -> float:
        """The way that set points may have led a wheel astray [m]."""
        self.astray = max(self.astray, self._open, self._way + self._doubt)
        return self.astray

    def _wrong(self, off: np.ndarray) -> None:
        """A wheel is off: send the set point again, or learn how that wheel is."""
        mover, last, follow = self.mover, self.mover.points[-1], self.follow
        counts = mover.faults.counts
        if counts[UNTOLD] > SPARE + sum(counts[kind] for kind in SPOILT):
            follow.learned = LEARNED + 1
            self._forgive()
            return
        follow.tries[off > 0] += 1
        if (follow.tries > TRIES).any():
            self._learn(follow.tries > TRIES)
            return
        mover.faults.note(UNTOLD, str(last.units), f"{off.max():.0f}")
        sizes = zip(last.units, mover.robot.wheels, strict=True)
        again = mover.robot.drive(*(self._metres(u) * f for u, f in sizes), times=2)
        self._doubt += self._metres(off.max()) * (again.at - self._good)
        seen = self._seen
        self._low, self._high, self._from = seen - SLACK, seen + SLACK, seen
        self._since = self._good = again.at
        self._next = again.at + SETTLED

    def _learn(self, which: np.ndarray) -> None:
        """Take what the speeds show for how wheels are; the line is not to blame."""
        follow, self._doubt = self.follow, 0.0
        which = which & (np.abs(self._told) > FAST)
        if not which.any():
            return  # at the next fast command
        shown = self._seen / np.where(which, self._told, 1.0)
        follow.shares = np.where(which, np.clip(shown, 0.0, 1.5), follow.shares)
        follow.tries[:] = 0
        follow.learned += 1
        self._forgive()

    def _forgive(self) -> None:
        """The line is not to blame for what was off so far."""
        self.odd, self._doubt, self._open, self._way = True, 0.0, 0.0, 0.0
        said = ", ".join(f"{share:.2f}" for share in self.follow.shares)
        self.mover.faults.note("a wheel does not follow", str(self._told), said)

    def _expected(self, now: float) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
        """Lowest, highest and usual speeds at a time [units]."""
        kept = np.exp(-(now - self._since) / np.array(LAGS))
        ends = np.stack([self._low, self._high, self._from])
        goal = self._told * self.follow.shares
        ways = goal + (ends - goal) * kept[:, None, None]
        return ways.min((0, 1)), ways.max((0, 1)), ways[1, 2]

    def _off(self) -> np.ndarray:
        """By how much set points seem to be wrong [units], 0 where they do not."""
        seen = np.array(self.mover.robot.speeds(), float)
        now = self.mover.clock.now()
        low, high, usual = self._expected(now)
        slack = SLACK + SHARE * np.abs(self._told).max()
        self._seen, self._sure = seen, bool((high - low).max() < SLACK)
        good = (seen >= low - slack) & (seen <= high + slack)
        shown = 1 - np.exp(-(now - self._since) / LAGS[1])
        return np.where(good, 0.0, np.abs(seen - usual) / max(shown, 0.2))

    def _metres(self, units: float) -> float:
        return self.mover.robot.units.speed(float(units))
