"""What is used of the messages of ROS 2: joint states, trajectories, arrays."""

from pathlib import Path

import msgspec

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.ros2_bag import Log

FIELDS = {
    "position": tables.POSITION,
    "velocity": tables.SPEED,
    "effort": tables.EFFORT,
}
Values = list[float | None] | None


class Stamp(msgspec.Struct):
    """A moment or a time, as ROS 2 writes it."""

    sec: int = 0
    nanosec: int = 0
    nsec: int = 0

    @property
    def whole(self) -> int:
        """It in nanoseconds."""
        return self.sec * 1_000_000_000 + (self.nanosec or self.nsec)


class Header(msgspec.Struct):
    """What is used of a std_msgs/Header."""

    stamp: Stamp = msgspec.field(default_factory=Stamp)

    @property
    def moment(self) -> int:
        """The stamp [ns]; 0 = none."""
        return self.stamp.whole


class Point(msgspec.Struct):
    """What is used of a trajectory_msgs/JointTrajectoryPoint."""

    positions: Values = None
    velocities: Values = None
    accelerations: Values = None
    effort: Values = None
    time_from_start: Stamp = msgspec.field(default_factory=Stamp)

    @property
    def ahead(self) -> float:
        """When it is to be reached, from the message on [s]."""
        return self.time_from_start.whole * 1e-9

    @property
    def states(self) -> tuple[Values, Values, Values]:
        """Positions, velocities and accelerations."""
        return self.positions, self.velocities, self.accelerations


class Message(msgspec.Struct):
    """What is used of a message of any kind that is read."""

    header: Header = msgspec.field(default_factory=Header)
    name: list[str] | None = None
    joint_names: list[str] | None = None
    points: list[Point] | None = None
    position: Values = None
    velocity: Values = None
    effort: Values = None
    data: Values = None

    @property
    def joints(self) -> list[str]:
        """Names of the joints; none in an array."""
        return self.name or self.joint_names or []

    @property
    def given(self) -> dict[str, list[float | None]]:
        """What is given of the joints, by field."""
        if self.points:
            point = self.points[0]
            three = point.positions, point.velocities, point.effort
        elif self.data is not None:
            three = self.data, None, None
        else:
            three = self.position, self.velocity, self.effort
        return {
            field: values or [] for field, values in zip(FIELDS, three, strict=True)
        }


def typed(log: Log, topic: str, path: Path) -> list[tuple[tuple[int, int], Message]]:
    """Messages of a topic, decoded to objects or to dictionaries, as one type.

    Args:
        log: the messages and their stamps, see `mcap_log.messages`.
        topic: for messages of errors.
        path: likewise.

    Raises:
        FormatError: a field of one holds something else than it should.
    """
    made = []
    for stamps, message in log:
        try:
            typed = msgspec.convert(message, Message, from_attributes=True)
        except (msgspec.ValidationError, ValueError, RecursionError) as error:
            raise FormatError(f"{path}: a message on {topic}: {error}.") from None
        made.append((stamps, typed))
    return made
