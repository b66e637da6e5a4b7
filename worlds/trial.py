"""What a robot was told and what was seen of it: `Commands` and `Trial`.

SI units throughout: m, rad, s, m/s. A planar pose is (x, y, yaw) in the world
frame: x to the right of the board, y to its top, yaw counter-clockwise from x and
continuous (a full turn adds 2 pi). In the body frame x is forward and y is left.
"""

from collections.abc import Mapping
from dataclasses import dataclass, field, replace
from typing import TYPE_CHECKING, Any, NamedTuple

import numpy as np
from numpy.typing import ArrayLike

from bns.errors import BnsError
from bns.models.robot_model import Channel as Channel

POSE = ("x", "y", "yaw")


POSE_CHANNELS = (Channel("x", "m"), Channel("y", "m"), Channel("yaw", "rad"))
WHEEL_CHANNELS = (Channel("left_speed", "m/s"), Channel("right_speed", "m/s"))


def _frozen(array: ArrayLike, ndim: int, name: str) -> np.ndarray:
    made = np.array(array, dtype=np.float64, order="C")
    if made.ndim != ndim:
        raise BnsError(f"{name} has {made.ndim} dimensions, it needs {ndim}.")
    made.setflags(write=False)
    return made


@dataclass(frozen=True, eq=False)
class Commands:
    """An open-loop list of commands, each held for its own duration.

    Attributes:
        values: what the robot is told, shape ``(K, C)``, one column a channel.
        durations: how long each command is held [s], shape ``(K,)``, positive.
        channels: the C channels with their units.

    Raises:
        BnsError: shapes disagree, a value is not finite, a duration is not positive.
    """

    values: np.ndarray
    durations: np.ndarray
    channels: tuple[Channel, ...] = WHEEL_CHANNELS

    if TYPE_CHECKING:  # lists will do

        def __init__(
            self,
            values: ArrayLike,
            durations: ArrayLike,
            channels: tuple[Channel, ...] = WHEEL_CHANNELS,
        ) -> None: ...

    def __post_init__(self) -> None:
        values = _frozen(self.values, 2, "Commands.values")
        durations = _frozen(self.durations, 1, "Commands.durations")
        if values.shape != (len(durations), len(self.channels)):
            raise BnsError(
                f"Commands.values has shape {values.shape}, it needs "
                f"({len(durations)}, {len(self.channels)}): a row per duration, "
                "a column per channel."
            )
        if not np.isfinite(values).all():
            raise BnsError(
                "Commands.values holds NaN or infinity; give finite numbers."
            )
        if not (np.isfinite(durations).all() and (durations > 0).all()):
            raise BnsError("Commands.durations must be positive, finite seconds.")
        object.__setattr__(self, "values", values)
        object.__setattr__(self, "durations", durations)

    def __len__(self) -> int:
        return len(self.durations)

    @property
    def duration(self) -> float:
        """Total time [s]."""
        return float(self.durations.sum())


class Outcome(NamedTuple):
    """What happened in a trial, beside what was measured.

    Attributes:
        left_arena: the robot was beyond the board's edge.
        fell: it tilted too far.
        diverged: the physics did; what was measured is not to be trusted.
        stopped: somebody or something stopped it early.
        collided: parts of the robot touched each other.
        overloaded: a servo pushed in vain for too long.
        overheated: a servo became too hot.
        unrested: a command ended by its time limit, not by the robot's rest.
        edge_turns: how often it was turned at the board's edge.
        lamp_stops: how often it was stopped, or turned, at a lamp's safety boundary.
    """

    left_arena: bool = False
    fell: bool = False
    diverged: bool = False
    stopped: bool = False
    collided: bool = False
    overloaded: bool = False
    overheated: bool = False
    unrested: bool = False
    edge_turns: int = 0
    lamp_stops: int = 0

    @property
    def usable(self) -> bool:
        """Whether the measurements may train a simulator."""
        return not self.diverged


@dataclass(frozen=True, eq=False)
class Trial:
    """One execution in a world.

    Attributes:
        commands: what was sent (before any effect changed it), K commands.
        times: time of each sample [s], shape ``(T,)``, increasing.
        observed: the samples, shape ``(T, n_channels)``, NaN where one was lost.
        channels: the observed channels; planar worlds give `POSE_CHANNELS` first.
        boundaries: sample index at the start and at the end of each command,
            shape ``(K + 1,)``.
        outcome: flags.
        robot: name of the robot model.
        world: name of the world.
        conditions: what was true of the world, damage included; written to the
            record, never shown to the learner.
        truth: samples of hidden quantities by name, each ``(T, ...)`` (for example
            ``qpos``); for pictures and tests, never shown to the learner.
        handled: commands during which the robot was not left to itself (stopped, or
            turned by hand), shape ``(K,)``: their motion is no motion of the robot.
            Its next command then starts from rest. Empty = none.
    """

    commands: Commands
    times: np.ndarray
    observed: np.ndarray
    boundaries: np.ndarray
    channels: tuple[Channel, ...] = POSE_CHANNELS
    outcome: Outcome = Outcome()
    robot: str = ""
    world: str = ""
    conditions: Mapping[str, object] = field(default_factory=dict)
    truth: Mapping[str, np.ndarray] = field(default_factory=dict)
    handled: np.ndarray = field(default_factory=lambda: np.zeros(0, bool))

    def __post_init__(self) -> None:
        times = _frozen(self.times, 1, "Trial.times")
        observed = _frozen(self.observed, 2, "Trial.observed")
        if observed.shape != (len(times), len(self.channels)):
            raise BnsError(
                f"Trial.observed has shape {observed.shape}, it needs "
                f"({len(times)}, {len(self.channels)})."
            )
        if not (np.diff(times) >= 0).all():
            raise BnsError("Trial.times goes backwards; sort the samples by time.")
        boundaries = np.array(self.boundaries, dtype=np.int64)
        if boundaries.shape != (len(self.commands) + 1,):
            raise BnsError(
                f"Trial.boundaries has shape {boundaries.shape}, it needs "
                f"({len(self.commands) + 1},)."
            )
        boundaries.setflags(write=False)
        handled = np.array(self.handled, dtype=bool)
        handled = handled if len(handled) else np.zeros(len(self.commands), bool)
        if handled.shape != (len(self.commands),):
            raise BnsError(
                f"Trial.handled has shape {handled.shape}, it needs "
                f"({len(self.commands)},)."
            )
        handled.setflags(write=False)
        object.__setattr__(self, "handled", handled)
        object.__setattr__(self, "times", times)
        object.__setattr__(self, "observed", observed)
        object.__setattr__(self, "boundaries", boundaries)

    def channel(self, name: str) -> np.ndarray:
        """Samples of the channel `name`, shape ``(T,)``.

        Raises:
            BnsError: the trial has no such channel.
        """
        names = [channel.name for channel in self.channels]
        if name not in names:
            raise BnsError(f"Trial has no channel {name!r}; it has {', '.join(names)}.")
        return self.observed[:, names.index(name)]

    @property
    def poses_world(self) -> np.ndarray:
        """Observed poses in the world frame, shape ``(T, 3)`` [m, m, rad]."""
        return np.stack([self.channel(name) for name in POSE], axis=1)

    @property
    def command_poses_world(self) -> np.ndarray:
        """Observed pose at the start and after each command, shape ``(K + 1, 3)``."""
        return self.poses_world[self.boundaries]

    def replace(self, **changes: Any) -> "Trial":
        """A copy with some attributes changed."""
        return replace(self, **changes)


def body_displacements(poses_world: np.ndarray) -> np.ndarray:
    """Motion between successive poses, in the body frame of the earlier one.

    Args:
        poses_world: ``(..., K + 1, 3)`` poses [m, m, rad].

    Returns:
        ``(..., K, 3)``: forward [m], left [m], turn [rad] (continuous).
    """
    poses = np.asarray(poses_world, dtype=np.float64)
    return body_displacement(poses[..., :-1, :], poses[..., 1:, :])


def body_displacement(begin: np.ndarray, end: np.ndarray) -> np.ndarray:
    """Motion from a pose to another, in the body frame of the first.

    Args:
        begin, end: poses ``(..., 3)`` [m, m, rad].

    Returns:
        ``(..., 3)``: forward [m], left [m], turn [rad] (continuous).
    """
    step = end - begin
    cos, sin = np.cos(begin[..., 2]), np.sin(begin[..., 2])
    return np.stack(
        [
            cos * step[..., 0] + sin * step[..., 1],
            -sin * step[..., 0] + cos * step[..., 1],
            step[..., 2],
        ],
        axis=-1,
    )
