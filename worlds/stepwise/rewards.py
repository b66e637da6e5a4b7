"""What an episode is rewarded for, in each world."""

from collections.abc import Sequence
from typing import Protocol

import numpy as np

from bns.worlds.checks import bounded
from bns.worlds.trial import Trial

GOALS = ((0.3, -0.3), (-0.3, -0.3), (-0.3, 0.3), (0.3, 0.3))
"""m; where navigation goes to by default: the corners of a square in this order"""

REACH = 0.09
"""m; within it a goal counts as reached (thesis, Algorithm 5)"""

GOAL_RADIUS = 0.3
"""m; distance from the lamp to be kept; assumed, the dissertation is silent"""


class Reward(Protocol):
    """What a step is worth, and what the robot is told of its goal."""

    names: tuple[str, ...]
    """of what `goal` gives"""

    def begin(self, trial: Trial) -> None:
        """An episode begins."""
        ...

    def goal(self) -> np.ndarray:
        """Further observations, one for each of `names`."""
        ...

    def of(self, trial: Trial) -> float:
        """What the last command was worth."""
        ...

    def done(self) -> bool:
        """Whether there is nothing left to do."""
        ...


class Waypoints:
    """Minus the distance to the next of several goals [m]; 1 for one that is reached.

    Args:
        goals: where to go, in order [m].
    """

    names: tuple[str, ...] = ("goal_x", "goal_y")

    def __init__(self, goals: Sequence[Sequence[float]] = GOALS):
        self.goals = np.array(
            [[bounded("goal", v, -10.0, 10.0, "m") for v in goal] for goal in goals]
        ).reshape(-1, 2)
        self.reached = 0

    def begin(self, trial: Trial) -> None:
        """The first goal is next."""
        self.reached = 0

    def goal(self) -> np.ndarray:
        """The next goal [m]."""
        return self.goals[min(self.reached, len(self.goals) - 1)]

    def of(self, trial: Trial) -> float:
        """Of the last command."""
        if self.done():
            return 0.0
        way = float(np.hypot(*(trial.observed[-1, :2] - self.goal())))
        if way < REACH:
            self.reached += 1
            return 1.0
        return -way

    def done(self) -> bool:
        """Whether all were reached."""
        return self.reached == len(self.goals)


class StayByLight:
    """Minus the distance from a circle around the lamp, over that of the start.

    One term of the dissertation's equation 5.2, so that an episode's sum is the fitness
    of one of its executions.

    Args:
        lamp: where it is [m].
        radius: of the circle [m].
    """

    names: tuple[str, ...] = ()

    def __init__(self, lamp: Sequence[float], radius: float = GOAL_RADIUS):
        self.lamp = np.array(lamp, dtype=np.float64)
        self.radius = bounded("goal radius", radius, 0.0, 10.0, "m")
        self._scale = 1.0

    def begin(self, trial: Trial) -> None:
        """Distances are in units of the first one."""
        self._scale = max(self._away(trial), 1e-3)

    def goal(self) -> np.ndarray:
        """Nothing, ``(0,)``: the robot has its sensors."""
        return np.zeros(0)

    def of(self, trial: Trial) -> float:
        """Of the last command."""
        return -abs(self._away(trial) - self.radius) / self._scale

    def done(self) -> bool:
        """Never."""
        return False

    def _away(self, trial: Trial) -> float:
        return float(np.hypot(*(trial.observed[-1, :2] - self.lamp)))


class Distance:
    """How far the robot came from where it was [m], as walking is judged."""

    names: tuple[str, ...] = ()

    def __init__(self) -> None:
        self._before = 0.0

    def begin(self, trial: Trial) -> None:
        """It has come no way."""
        self._before = 0.0

    def goal(self) -> np.ndarray:
        """Nothing, ``(0,)``."""
        return np.zeros(0)

    def of(self, trial: Trial) -> float:
        """Of the last command; the sum of an episode is its displacement."""
        now = float(np.hypot(*(trial.observed[-1, :2] - trial.observed[0, :2])))
        gain, self._before = now - self._before, now
        return gain

    def done(self) -> bool:
        """Never."""
        return False
