"""MCAP logs of ROS 2: joint states, and the commands of a controller.

States are sensor_msgs/JointState; commands are JointState, trajectory_msgs/
JointTrajectory or std_msgs/Float64MultiArray on a topic whose name says so. Points of a
trajectory that lie ahead are gone to as a controller does (`ros2_trajectory`). Messages
may be CDR or JSON. Stamps are those of the headers where all messages have one, else
those of the log: two clocks are not mixed.
"""

from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.gap.importers import ros2_bag, ros2_topics, ros2_trajectory, tables
from bns.gap.importers.ros2_messages import FIELDS, Message, typed
from bns.gap.importers.ros2_trajectory import Plan
from bns.gap.importers.tables import Column, Table

AHEAD = "told as points ahead: gone to as joint_trajectory_controller does"
ARRIVED = "headers without a stamp: times are those at which messages were logged"
STAMPED = "Give headers no stamp to use the times at which messages were logged."
Stamps = tuple[int, int]
Log = list[tuple[Stamps, Message]]


def read(path: Path) -> Table:
    """The table of a log; columns are named as `/joint_states:position.JOINT`.

    Args:
        path: a file, or a directory of rosbag2 with some.

    Raises:
        MissingDependencyError: `mcap`, or `mcap-ros2-support` for CDR messages.
        FormatError: no joint states or no commands in it, or several of them and it
            cannot be told which are the robot's.
    """
    bag = ros2_bag.opened(path)
    state, command, notes = ros2_topics.chosen(bag)
    logs = {
        topic: typed(log, topic, path)
        for topic, log in bag.messages({state, command}).items()
    }
    own = all(m.header.moment > 0 for log in logs.values() for _, m in log)
    zero = min(_moment(log[0], own) for log in logs.values())
    states = [m for _, m in logs[state]]
    times = _times(logs[state], own, zero, path, state)
    sent = _times(logs[command], own, zero, path, command)
    seen = _columns(states, state, tables.SEEN, path)
    messages = [m for _, m in logs[command]]
    if any(point.ahead for message in messages for point in message.points or ()):
        sent, told = _followed(messages, sent, times, seen, command, path)
        notes = (*notes, f"{command}: {AHEAD}")
    else:
        told = _columns(messages, command, tables.TOLD, path)
    moments, columns = tables.joined(times, seen, sent, told)
    notes = notes if own else (*notes, ARRIVED)
    return tables.stamped(moments, columns, "MCAP log", None, notes)


def _times(log: Log, own: bool, zero: int, path: Path, topic: str) -> np.ndarray:
    """Stamps of messages [s].

    Raises:
        FormatError: they go backwards.
    """
    stamps = np.array([(_moment(item, own) - zero) * 1e-9 for item in log])
    tables.forward(stamps, path, f"the stamp on {topic}", STAMPED if own else "")
    return stamps


def _followed(
    messages: list[Message],
    sent: np.ndarray,
    times: np.ndarray,
    seen: list[Column],
    topic: str,
    path: Path,
) -> tuple[np.ndarray, list[Column]]:
    """Moments and columns of the commands between points that lie ahead.

    Raises:
        FormatError: see `_plan`.
    """
    names = messages[0].joints
    plans = [_plan(message, names, topic, path) for message in messages]
    last = max(int(np.searchsorted(times, sent[0], side="right")) - 1, 0)
    angles = {c.part: c.values[last] for c in seen if c.quantity == tables.POSITION}
    first = np.array([angles.get(name, np.nan) for name in names])
    when = ros2_trajectory.moments(times, sent)
    made = ros2_trajectory.goals(plans, sent, first, when)
    about = tables.TOLD, tables.POSITION
    return when, [
        Column(f"{topic}:position.{name}", made[:, at], about[0], name, about[1])
        for at, name in enumerate(names)
    ]


def _plan(message: Message, names: list[str], topic: str, path: Path) -> Plan:
    """The points of a message, its joints in the order of `names`.

    Raises:
        FormatError: other joints, points without positions, or times that do not grow.
    """
    points = message.points or []
    if sorted(message.joints) != sorted(names) or len(set(names)) < len(names):
        raise FormatError(f"{path}: the joints on {topic} change on the way.")
    times = np.array([point.ahead for point in points])
    states = np.full((len(points), 3, len(names)), np.nan)
    for at, point in enumerate(points):
        for kind, values in enumerate(point.states):
            if values and len(values) == len(names):
                states[at, kind] = np.array(values, dtype=float)
    order = [message.joints.index(name) for name in names]
    whole = len(points) and np.isfinite(states[:, 0]).all()
    if not whole or (np.diff(times, prepend=0.0) < 0).any():
        raise FormatError(
            f"{path}: a message on {topic} is no trajectory that a controller takes: "
            "it needs points with a position of each joint, and a time_from_start "
            "that grows."
        )
    return Plan(times, states[:, :, order])


def _moment(item: tuple[Stamps, Message], own: bool) -> int:
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
