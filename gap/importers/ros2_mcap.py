"""MCAP logs of ROS 2: joint states, and the commands of a controller.

States are sensor_msgs/JointState; commands are JointState, trajectory_msgs/
JointTrajectory (its first point) or std_msgs/Float64MultiArray on a topic whose name
says so. Messages may be CDR or JSON. Stamps are those of the headers where all messages
have one, else those of the log: two clocks are not mixed.
"""

import re
from pathlib import Path
from typing import Any

import msgspec
import numpy as np

from bns.errors import FormatError
from bns.gap.importers import tables
from bns.gap.importers.tables import Column, Table
from bns.worlds.data import mcap_log

STATE, TRAJECTORY, ARRAY = "JointState", "JointTrajectory", "Float64MultiArray"
COMMAND = re.compile(r"command|cmd|goal|desired|target|reference|setpoint|trajectory")
FIELDS = {
    "position": tables.POSITION,
    "velocity": tables.SPEED,
    "effort": tables.EFFORT,
}
Values = list[float | None] | None
Log = list[tuple[tuple[int, int], Any]]


class Stamp(msgspec.Struct):
    """A moment, as ROS 2 writes it."""

    sec: int = 0
    nanosec: int = 0
    nsec: int = 0


class Header(msgspec.Struct):
    """What is used of a std_msgs/Header."""

    stamp: Stamp = msgspec.field(default_factory=Stamp)

    @property
    def moment(self) -> int:
        """The stamp [ns]; 0 = none."""
        return self.stamp.sec * 1_000_000_000 + (self.stamp.nanosec or self.stamp.nsec)


class Point(msgspec.Struct):
    """What is used of a trajectory_msgs/JointTrajectoryPoint."""

    positions: Values = None
    velocities: Values = None
    effort: Values = None


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


def read(path: Path) -> Table:
    """The table of a log; columns are named as `/joint_states:position.JOINT`.

    Raises:
        MissingDependencyError: `mcap`, or `mcap-ros2-support` for CDR messages.
        FormatError: no joint states or no commands in it, or more than one of them.
    """
    state, command = _chosen(mcap_log.topics(path), path)
    logs = {
        topic: _typed(log, topic, path)
        for topic, log in mcap_log.messages(path, {state, command}).items()
    }
    own = all(m.header.moment > 0 for log in logs.values() for _, m in log)
    zero = min(_moment(log[0], own) for log in logs.values())
    seen = _columns([m for _, m in logs[state]], state, tables.SEEN, path)
    told = _columns([m for _, m in logs[command]], command, tables.TOLD, path)
    times = np.array([(_moment(item, own) - zero) * 1e-9 for item in logs[state]])
    sent = np.array([(_moment(item, own) - zero) * 1e-9 for item in logs[command]])
    for stamps, topic in ((times, state), (sent, command)):
        if (np.diff(stamps) < 0).any():
            raise FormatError(f"{path}: stamps on {topic} go backwards.")
    moments, columns = tables.joined(times, seen, sent, told)
    return tables.stamped(moments, columns, "MCAP log", None)


def _chosen(topics: dict[str, str], path: Path) -> tuple[str, str]:
    """The topics of states and of commands."""
    kinds = {name: schema.rpartition("/")[2] for name, schema in topics.items()}
    told = [
        name
        for name, kind in kinds.items()
        if kind == TRAJECTORY
        or (kind in (STATE, ARRAY) and COMMAND.search(name.lower()))
    ]
    seen = [name for name, kind in kinds.items() if kind == STATE and name not in told]
    for found, what in ((seen, "joint states"), (told, "commands")):
        if len(found) != 1:
            there = ", ".join(f"{n} ({topics[n]})" for n in sorted(topics)) or "none"
            raise FormatError(
                f"{path} has {len(found)} topics of {what}, one is needed; its topics: "
                f"{there}. Filter it with `mcap filter`."
            )
    return seen[0], told[0]


def _typed(log: Log, topic: str, path: Path) -> list[tuple[tuple[int, int], Message]]:
    """Messages of a topic, decoded to objects or to dictionaries, as one type.

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


def _moment(item: tuple[tuple[int, int], Message], own: bool) -> int:
    return item[1].header.moment if own else item[0][0]


def _columns(
    contents: list[Message], topic: str, role: str, path: Path
) -> list[Column]:
    """Columns of a topic; joints keep the order of its first message."""
    names, first = contents[0].joints, contents[0].given
    made: list[Column] = []
    for field, quantity in FIELDS.items():
        count = len(first[field])
        if not count:
            continue
        joints = tables.named(names, count)
        rows = []
        for message in contents:
            values, listed = message.given[field], message.joints
            if len(values) != count or sorted(listed) != sorted(names):
                raise FormatError(f"{path}: the joints on {topic} change on the way.")
            order = {name: at for at, name in enumerate(listed)}
            rows.append(
                [values[order.get(joint, at)] for at, joint in enumerate(joints)]
            )
        table = np.array(rows, dtype=float)
        for at, joint in enumerate(joints):
            part = joint if names else ""
            label = f"{topic}:{field}.{joint}"
            made.append(Column(label, table[:, at], role, part, quantity))
    if not made:
        raise FormatError(f"{path}: messages on {topic} hold no joints.")
    return made
