"""Whether a robot on wheels is seen to move as it is told.

A picture that stands still although its time stamps go on shows a robot that stands
where it drives. How far the wheels must have come between two pictures follows from
their set points: they lag, by a time constant that is known within a factor, so their
speeds lie between bounds, and the integrals of the bounds are bounds of the way. Below
the smallest speed that the robot regulates a wheel need not turn at all.
"""

from collections import deque
from typing import NamedTuple

import numpy as np

from bns.hardware.tracking.tracker import Sighting

LAGS = (0.04, 0.28)  # s, time constants of the wheels, least and most; see `wheels`
DELAYS = np.array([0.0, 0.025, 0.05, 0.075, 0.1])
"""s by which a picture may be older than its time stamp says"""
MUST = 0.0015  # m that a wheel must have come before anything is concluded
LEAST = 0.0003  # m that are seen of a robot at rest: 5 standard deviations; rendered
SLOWEST = 0.014  # m/s; smallest regulated speed (manual 2.2, p. 14)
AXLE = 0.0884  # m
KEPT = 1.0  # s of sightings and set points
FAR = 100.0  # m; no bound
GRID = 0.01  # s; bounds are integrated on it


class _Segment(NamedTuple):
    """From one set point to the next; ``(2,)`` are left and right [m/s].

    Attributes:
        begin: when it began [s].
        goals: lowest and highest speed that it may lead to, ``(2, 2)``.
        speeds: bounds of the speeds when it began, ``(2, 2)``.
    """

    begin: float
    goals: np.ndarray
    speeds: np.ndarray

    def bounds(self, at: float) -> np.ndarray:
        """Lowest and highest speeds at a time, ``(2, 2)`` [m/s].

        Between two lags a first-order response lies between those of either.
        """
        if not np.isfinite(self.begin):
            return self.speeds
        kept = np.exp([-(at - self.begin) / lag for lag in LAGS])[:, None, None]
        ways = self.goals + (self.speeds - self.goals) * kept
        return np.stack([ways[:, 0].min(0), ways[:, 1].max(0)])


class MotionCheck:
    """Compares sightings with set points."""

    def __init__(self) -> None:
        still = np.zeros((2, 2))
        self._segments = deque([_Segment(-np.inf, still, still)])
        self._seen: deque[tuple[Sighting, np.ndarray]] = deque()
        self._excused = False

    def told(self, at: float, left: float, right: float) -> None:
        """A set point holds.

        Args:
            at: since when [s].
            left, right: speeds over the floor [m/s].
        """
        goal = np.array([left, right])
        slow = np.abs(goal) < SLOWEST
        goals = np.stack([np.where(slow, np.minimum(goal, 0), goal)] * 2)
        goals[1, slow] = np.maximum(goal, 0)[slow]
        self._segments.append(_Segment(at, goals, self._segments[-1].bounds(at)))
        while len(self._segments) > 2 and self._segments[1].begin < at - 2 * KEPT:
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
        begin = self._seen[-1][0].time if self._seen else sighting.time
        self._seen.append((sighting, self._ways(begin, sighting.time)))
        while self._seen[0][0].time < sighting.time - KEPT:
            self._seen.popleft()
        if self._excused:
            return False
        ways = np.zeros((2, 2))  # bounds from an earlier sighting on
        for later in range(len(self._seen) - 1, 0, -1):
            ways = ways + self._seen[later][1] * shares
            if max(ways[0].max(), -ways[1].min()) >= MUST:
                return _way(self._seen[later - 1][0].pose, sighting.pose) < LEAST
        return False

    def _ways(self, begin: float, end: float) -> np.ndarray:
        """Least and most that the wheels came between two times, ``(2, 2)`` [m]."""
        steps = max(round((end - begin) / GRID), 1)
        if end <= begin:
            return np.zeros((2, 2))
        if steps > KEPT / GRID:  # nothing was seen for long: it may be anywhere
            return np.array([[-FAR, -FAR], [FAR, FAR]])
        width = (end - begin) / steps
        return (
            sum(
                (self._shown(begin + (k + 0.5) * width) for k in range(steps)),
                np.zeros((2, 2)),
            )
            * width
        )

    def _shown(self, at: float) -> np.ndarray:
        """Bounds of the speeds that a picture with a time stamp shows, ``(2, 2)``."""
        found = np.stack([self._bounds(at - delay) for delay in DELAYS])
        return np.stack([found[:, 0].min(0), found[:, 1].max(0)])

    def _bounds(self, at: float) -> np.ndarray:
        return next(s for s in reversed(self._segments) if s.begin <= at).bounds(at)


def _way(before: np.ndarray, after: np.ndarray) -> float:
    """The longest way that a wheel or the centre came between two poses [m]."""
    step = after[:2] - before[:2]
    heading = (before[2] + after[2]) / 2
    ahead = step @ np.array([np.cos(heading), np.sin(heading)])
    turn = (after[2] - before[2]) * AXLE / 2
    return float(max(abs(ahead - turn), abs(ahead + turn), np.hypot(*step)))
