"""What Gymnasium and dm_env share: observations, actions, rewards of one robot."""

from copy import copy
from typing import Any, NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.worlds.stepwise.core import Stepwise
from bns.worlds.stepwise.rewards import Distance, Reward, StayByLight, Waypoints
from bns.worlds.trial import POSE_CHANNELS, Trial

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
