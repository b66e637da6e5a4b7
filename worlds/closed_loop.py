"""Closed loops: what steers robots from their readings, cycle by cycle."""

from collections.abc import Sequence
from typing import Any, Protocol, cast

import numpy as np

from bns.errors import BnsError, OutOfBoundsError
from bns.worlds.trial import Channel

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


def checked(
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
