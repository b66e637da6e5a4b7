"""The `World` protocol: all that a learner may know of reality; worlds that count."""

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from bns.errors import BnsError
from bns.worlds.trial import Commands, Trial

if TYPE_CHECKING:
    from bns.worlds.damage import Damage


@runtime_checkable
class World(Protocol):
    """A place where robots execute commands.

    A world holds no hidden state between calls: what a trial gives depends on its
    commands, its damage, its trial number and its seed alone, so that runs can be
    resumed and replayed.

    Attributes:
        name: registry name ("mujoco", "static-snn", ...).
        robot: name of the robot model.
    """

    name: str
    robot: str

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """Execute one list of commands on each of N robots, from the start pose.

        Args:
            commands: N lists of commands, one a robot.
            trial: number of this trial, counted from 0; effects have their onset
                on it.
            seeds: N seeds for what is random in the world (noise, jitter); empty
                means 0, 1, 2, ... The same seed and trial give the same bytes.

        Returns:
            N trials, in order. A diverged one is flagged, never raised.
        """
        ...


_reasons: list[str] = []


def ring(reason: str) -> None:
    """Raise the alarm.

    Args:
        reason: what happened, in a few words.
    """
    _reasons.append(reason)


def reason() -> str:
    """Why the alarm was raised; empty while it was not."""
    return _reasons[0] if _reasons else ""


def clear() -> None:
    """End the alarm."""
    _reasons.clear()


class BudgetSpentError(BnsError):
    """A learner asked for more evaluations of its model than it may have."""


class CountedWorld:
    """A model world of one run; a `World` that counts every execution.

    Args:
        world: what executes; it may be shared by several runs.
        limit: executions that the run may spend.

    Attributes:
        spent: executions so far; to be kept in the learner's state.
    """

    def __init__(self, world: World, limit: int):
        self._world, self.limit, self.spent = world, limit, 0
        self.name, self.robot = world.name, world.robot
        self._payer = self

    @property
    def left(self) -> int:
        """Executions that may still be spent."""
        return max(self.limit - self.spent, 0)

    def having(self, damages: "Sequence[Damage]") -> "CountedWorld":
        """The same model, each of its robots with something else wrong with it.

        What is executed there is charged here.

        Args:
            damages: one for each robot of the next `run`.

        Raises:
            BnsError: a model that has no effects, or not these.
        """
        able = getattr(self._world, "having", None)
        if able is None:
            raise BnsError(
                f"The model world {self.name!r} cannot be changed by effects: give "
                "--prior.world mujoco or hexapod."
            )
        other = copy(self)
        other._world = able(damages)
        return other

    def run(
        self, commands: Sequence[Commands], *, trial: int = 0, seeds: Sequence[int] = ()
    ) -> list[Trial]:
        """See `World.run`.

        Raises:
            BudgetSpentError: more than what is left; nothing is executed or charged.
        """
        self._payer._charge(len(commands))
        return self._world.run(commands, trial=trial, seeds=seeds)

    def drive(self, policy: Any, **settings: Any) -> list[Trial]:
        """Let N controllers steer a robot each, see `LightWorld.drive`.

        Raises:
            BudgetSpentError: more than what is left; nothing is executed or charged.
            BnsError: a world without closed loops.
        """
        drive = getattr(self._world, "drive", None)
        if drive is None:
            raise BnsError(
                f"The model world {self.name!r} has no closed loops: give "
                "--prior.world light."
            )
        self._payer._charge(len(policy))
        driven: list[Trial] = drive(policy, **settings)
        return driven

    def _charge(self, count: int) -> None:
        if count > self.left:
            raise BudgetSpentError(
                f"{count} evaluations of the model asked for, {self.left} of "
                f"{self.limit} left: raise prior.evaluations, or ask for fewer."
            )
        self.spent += count
