"""Whether a robot on wheels is seen to move as it is told.

A picture that stands still although its time stamps go on shows a robot that stands
where it drives. How far the wheels must have come between two pictures follows from
their set points. The wheels lag, and by how much is known within a factor, so that what
they must have done at least is the least of several lags; below the smallest speed that
the robot regulates they need not have done anything.
"""

from collections import deque

import numpy as np

from bns.hardware.tracking.tracker import Sighting

LAGS = np.array([0.04, 0.13, 0.28])  # s, time constant of the wheels; see `wheels`
DELAYS = (0.0, 0.05, 0.1)  # s by which a picture may be older than it says, for each
MUST = 0.0015  # m that a wheel must have come before anything is concluded
LEAST = 0.0003  # m that are seen of a robot at rest: 5 standard deviations; rendered
SLOWEST = 0.014  # m/s; smallest regulated speed (manual 2.2, p. 14)
AXLE = 0.0884  # m
KEPT = 1.0  # s of sightings and set points


class MotionCheck:
    """Compares sightings with set points.

    The path of each wheel after a change of set point is that of a first-order lag:
    ``x(t) = x0 + u t + (v0 - u) tau (1 - exp(-t / tau))``.
    """

    def __init__(self) -> None:
        still = np.zeros((len(LAGS), 2))
        self._segments: deque[tuple[float, np.ndarray, np.ndarray, np.ndarray]]
        self._segments = deque([(-np.inf, np.zeros(2), still, still)])
        self._seen: deque[Sighting] = deque()
        self._excused = False

    def told(self, at: float, left: float, right: float) -> None:
        """A set point holds.

        Args:
            at: since when [s].
            left, right: speeds over the floor [m/s].
        """
        goal = np.array([left, right])
        goal[np.abs(goal) < SLOWEST] = 0.0
        speed, place = self._at(self._segments[-1], at)
        self._segments.append((at, goal, speed, place))
        while len(self._segments) > 2 and self._segments[1][0] < at - 2 * KEPT:
            self._segments.popleft()
        self._excused = False

    def excuse(self) -> None:
        """It does stand: expect nothing until the next set point."""
        self._excused = True

    def stands(self, sighting: Sighting, shares: np.ndarray) -> bool:
        """Whether the robot is seen to stand although it must have moved.

        Args:
            sighting: the newest.
            shares: of its set point that each wheel is known to reach, ``(2,)``.
        """
        self._seen.append(sighting)
        while self._seen[0].time < sighting.time - KEPT:
            self._seen.popleft()
        if self._excused:
            return False
        end = self._path(sighting.time)
        for earlier in list(self._seen)[-2::-1]:
            ways = (end - self._path(earlier.time)) * shares
            least = np.where(
                (ways > 0).all(0) | (ways < 0).all(0), np.abs(ways).min(0), 0.0
            )
            if least.max() >= MUST:
                return _way(earlier.pose, sighting.pose) < LEAST
        return False

    def _path(self, at: float) -> np.ndarray:
        """Ways of the wheels until a time by each lag, ``(3, 2)`` [m]."""
        rows = []
        for row, delay in enumerate(DELAYS):
            segments = reversed(self._segments)
            segment = next(s for s in segments if s[0] <= at - delay)
            rows.append(self._at(segment, at - delay)[1][row])
        return np.array(rows)

    @staticmethod
    def _at(
        segment: tuple[float, np.ndarray, np.ndarray, np.ndarray], at: float
    ) -> tuple[np.ndarray, np.ndarray]:
        """Speeds and ways within a segment, ``(3, 2)`` each [m/s, m]."""
        begin, goal, speed, place = segment
        if not np.isfinite(begin):
            return speed, place
        time, lags = at - begin, LAGS[:, None]
        kept = np.exp(-time / lags)
        return (
            goal + (speed - goal) * kept,
            place + goal * time + (speed - goal) * lags * (1 - kept),
        )


def _way(before: np.ndarray, after: np.ndarray) -> float:
    """The longest way that a wheel or the centre came between two poses [m]."""
    step = after[:2] - before[:2]
    heading = (before[2] + after[2]) / 2
    ahead = step @ np.array([np.cos(heading), np.sin(heading)])
    turn = (after[2] - before[2]) * AXLE / 2
    return float(max(abs(ahead - turn), abs(ahead + turn), np.hypot(*step)))
