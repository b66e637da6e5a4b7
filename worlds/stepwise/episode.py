"""What Gymnasium and dm_env share: observations, actions, rewards of one robot."""

from collections.abc import Sequence
from copy import copy
from typing import Any, NamedTuple, Protocol

import numpy as np

from bns.errors import BnsError
from bns.worlds.checks import bounded
from bns.worlds.stepwise.core import Stepwise
from bns.worlds.trial import POSE_CHANNELS, Trial

GOALS = ((0.3, -0.3), (-0.3, -0.3), (-0.3, 0.3), (0.3, 0.3))
"""m; where navigation goes to by default: the corners of a square in this order"""

ARRIVED = 0.09
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
        if way < ARRIVED:
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


SPEED = 0.12152
"""m/s; what an action of 1 is for wheels: 17,500 units, the fastest the laboratory's
controllers drive"""

REACH = 20.0
"""m and rad; the largest pose that an observation can hold"""

FULL_SCALE = 4095.0
"""counts; of a light sensor"""


class Seen(NamedTuple):
    """What a step gave.

    Attributes:
        observation: shape ``(O,)``, see `Episode.names`.
        reward: of the last command.
        over: whether nothing can follow: task done, robot stopped, fallen or lost.
        late: whether the commands are used up.
        trial: the trial so far.
    """

    observation: np.ndarray
    reward: float
    over: bool
    late: bool
    trial: Trial


class Episode:
    """One robot, its task, actions from -1 to 1.

    In the world "light" the robot sees its light sensors alone, elsewhere what the
    world observes (its pose first) and the next goal.

    Args:
        world: registered name, or a world.
        reward: what is rewarded; None = what the world is for.
        settings: of `Stepwise`.
    """

    def __init__(
        self, world: Any = "light", *, reward: Reward | None = None, **settings: Any
    ):
        self.stepper = Stepwise(world, **settings)
        made = self.stepper.world
        self.blind = hasattr(made, "field")  # it sees no pose
        self.reward: Reward = reward or _usual(made, self.stepper.model.kind)
        low, high = self.stepper.bounds
        if self.stepper.model.kind == "wheeled":
            low, high = np.maximum(low, -SPEED), np.minimum(high, SPEED)
        self._middle, self._half = (low + high) / 2, (high - low) / 2
        channels = self.stepper.channels()
        shown = channels[len(POSE_CHANNELS) :] if self.blind else channels
        self._first = len(POSE_CHANNELS) if self.blind else 0
        self.names = tuple(channel.name for channel in shown) + self.reward.names
        self.low = np.array([_limits(channel)[0] for channel in shown] + self._ends(-1))
        self.high = np.array([_limits(channel)[1] for channel in shown] + self._ends(1))
        self._last = np.zeros(len(self.names))

    def another(self, reward: Reward | None = None) -> "Episode":
        """One more robot of the same world, with equal settings.

        Args:
            reward: its own; None = what the world is for.
        """
        made = copy(self)
        made.stepper = copy(self.stepper)
        made.reward = reward or _usual(self.stepper.world, self.stepper.model.kind)
        return made

    @property
    def actions(self) -> int:
        """How many numbers an action has."""
        return len(self._half)

    def _ends(self, sign: int) -> list[float]:
        return [sign * REACH] * len(self.reward.names)

    def begin(self, seed: int, start: Any = None) -> Seen:
        """Begin an episode, see `Stepwise.reset`."""
        return self.begun(self.stepper.reset(seed, start))

    def begun(self, trial: Trial) -> Seen:
        """What is seen at the begin of an episode; `trial` is that so far."""
        self.reward.begin(trial)
        self._last = np.zeros(len(self.names))
        return self._seen(trial, 0.0)

    def act(self, action: Any) -> Seen:
        """Do one command, see `command`."""
        return self.acted(self.stepper.step(self.command(action)))

    def command(self, action: Any) -> np.ndarray:
        """What the robot is told by an action, ``(C,)``, SI units.

        Args:
            action: shape ``(C,)``, from -1 to 1: from the slowest to the fastest.

        Raises:
            BnsError: another shape, or NaN.
        """
        given = np.asarray(action, dtype=np.float64)
        if given.shape != self._half.shape or not np.isfinite(given).all():
            raise BnsError(
                f"Action {given.tolist()} is not allowed: give {self.actions} finite "
                "numbers from -1 to 1."
            )
        made: np.ndarray = self._middle + self._half * np.clip(given, -1.0, 1.0)
        return made

    def acted(self, trial: Trial) -> Seen:
        """What is seen after a command; `trial` is that so far."""
        lost = not np.isfinite(trial.observed[-1]).all()
        return self._seen(trial, 0.0 if lost else self.reward.of(trial))

    def _seen(self, trial: Trial, reward: float) -> Seen:
        now = np.concatenate([trial.observed[-1, self._first :], self.reward.goal()])
        self._last = np.where(np.isfinite(now), now, self._last)
        outcome = trial.outcome
        over = outcome.diverged or outcome.fell or outcome.stopped
        return Seen(
            observation=np.clip(self._last, self.low, self.high),
            reward=float(reward),
            over=bool(over or self.reward.done()),
            late=self.stepper.count >= self.stepper.cycles,
            trial=trial,
        )


def _usual(world: Any, kind: str) -> Reward:
    if hasattr(world, "field"):
        return StayByLight(world.field.positions[0, :2])
    return Distance() if kind == "legged" else Waypoints()


def _limits(channel: Any) -> tuple[float, float]:
    return (0.0, FULL_SCALE) if channel.unit == "count" else (-REACH, REACH)
