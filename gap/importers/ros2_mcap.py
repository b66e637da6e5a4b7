"""MCAP logs of ROS 2: joint states, and the commands of a controller.

States are sensor_msgs/JointState; commands are JointState, trajectory_msgs/
JointTrajectory (its first point) or std_msgs/Float64MultiArray on a topic whose name
says so. Messages may be CDR or JSON. Stamps are those of the headers where all messages
have one, else those of the log: two clocks are not mixed.
"""

import re
from pathlib import Path
from typing import Any

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
PLURAL = {"position": "positions", "velocity": "velocities", "effort": "effort"}


def read(path: Path) -> Table:
    """The table of a log; columns are named as `/joint_states:position.JOINT`.

    Raises:
        MissingDependencyError: `mcap`, or `mcap-ros2-support` for CDR messages.
        FormatError: no joint states or no commands in it, or more than one of them.
    """
    state, command = _chosen(mcap_log.topics(path), path)
    logs = mcap_log.messages(path, {state, command})
    own = all(_stamp(m) > 0 for log in logs.values() for _, m in log)
    zero = min(_moment(log[0], own) for log in logs.values())
    seen = _columns(logs[state], state, tables.SEEN, path)
    told = _columns(logs[command], command, tables.TOLD, path)
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


def _get(message: Any, name: str, default: Any = None) -> Any:
    """A field of a message, decoded to an object or to a dictionary."""
    if isinstance(message, dict):
        return message.get(name, default)
    return getattr(message, name, default)


def _stamp(message: Any) -> int:
    """The header's stamp [ns]; 0 = none."""
    stamp = _get(_get(message, "header", {}), "stamp", {})
    seconds = _get(stamp, "sec", 0)
    return int(seconds) * 1_000_000_000 + int(
        _get(stamp, "nanosec", _get(stamp, "nsec", 0))
    )


def _moment(item: tuple[tuple[int, int], Any], own: bool) -> int:
    return _stamp(item[1]) if own else item[0][0]


def _content(message: Any) -> tuple[list[str], dict[str, list[float]]]:
    """Names of joints, and what is given of them by field."""
    names = list(
        _get(message, "name", None) or _get(message, "joint_names", None) or []
    )
    points = _get(message, "points")
    if points:
        return names, {f: list(_get(points[0], PLURAL[f], [])) for f in FIELDS}
    array = _get(message, "data")
    if array is not None:
        return names, {"position": list(array)}
    return names, {field: list(_get(message, field, [])) for field in FIELDS}


def _columns(log: list, topic: str, role: str, path: Path) -> list[Column]:
    """Columns of a topic; joints keep the order of its first message."""
    contents = [_content(message) for _, message in log]
    names, first = contents[0]
    made = []
    for field, quantity in FIELDS.items():
        count = len(first.get(field, ()))
        if not count:
            continue
        joints = tables.named(names, count)
        rows = []
        for listed, given in contents:
            values = given.get(field, [])
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
