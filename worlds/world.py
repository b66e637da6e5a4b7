"""The `World` protocol: all that a learner may know of reality."""

from collections.abc import Sequence
from typing import Protocol, runtime_checkable

from bns.worlds.trial import Commands, Trial


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
