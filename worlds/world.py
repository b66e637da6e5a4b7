"""What a learner may know of reality: `World`, and `Policy` in closed loops.

A `Policy` steers robots from their readings, cycle by cycle. `CountedWorld` counts.
"""

from collections.abc import Sequence
from copy import copy
from typing import TYPE_CHECKING, Any, Protocol, runtime_checkable

from bns.errors import BnsError
from bns.worlds.trial import Commands, Trial

if TYPE_CHECKING:
    from bns.worlds.damage import Damage
from typing import cast

import numpy as np

from bns.errors import OutOfBoundsError
from bns.worlds.trial import Channel


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


CYCLE = 0.4
"""s; each command is held so long, then the sensors are read (thesis 5.2.2)"""

CYCLES = 100
"""commands of one trial (thesis 5.2.2)"""


class Policy(Protocol):
    """N controllers as one batch, one a robot.

    It holds no state of its own: what a controller remembers goes in and out.
    """

    def memory(self, n: int) -> np.ndarray:
        """What n controllers remember at the start, shape ``(n, M)``; M may be 0."""
        ...

    def act(
        self, readings: np.ndarray, memory: np.ndarray
    ) -> tuple[np.ndarray, np.ndarray]:
        """The next command of each robot.

        Args:
            readings: of the sensors, shape ``(n, S)`` [counts]; not to be written to.
            memory: shape ``(n, M)``, as the last call gave it.

        Returns:
            commands ``(n, C)`` in the robot's channels (wheel speeds [m/s]), and the
            memory ``(n, M)``.
        """
        ...


def checked_commands(
    commands: object, channels: Sequence[Channel], limits: np.ndarray, n: int, at: int
) -> np.ndarray:
    """What a policy told the robots, if they can be told it.

    Args:
        commands: what it gave.
        channels: what the robots are told.
        limits: largest magnitude of each, shape ``(C,)``.
        n: number of robots.
        at: number of the cycle, for the message.

    Returns:
        Shape ``(n, C)``.

    Raises:
        BnsError: another shape, no numbers, NaN or infinity.
        OutOfBoundsError: a command beyond the limits.
    """
    try:
        values = np.array(commands, dtype=np.float64)
    except (TypeError, ValueError):
        values = np.empty(0)
    if values.shape != (n, len(channels)):
        raise BnsError(
            f"The policy gave commands of shape {np.shape(cast(Any, commands))} in "
            f"cycle {at}; it needs ({n}, {len(channels)}): a row per robot, a column "
            "per channel."
        )
    bad = np.flatnonzero(~np.isfinite(values).all(axis=1))
    if len(bad):
        raise BnsError(
            f"The policy told robot {bad[0]} {values[bad[0]].tolist()} in cycle {at}; "
            "give finite numbers (are its weights finite?)."
        )
    beyond = np.argwhere(np.abs(values) > limits * (1 + 1e-9))
    if len(beyond):
        robot, column = beyond[0]
        raise OutOfBoundsError(
            f"cycle {at}, robot {robot}: {channels[column].name}",
            values[robot, column],
            -limits[column],
            limits[column],
            channels[column].unit,
        )
    return values
