"""Which topics of a log are the robot's joint states and its commands."""

import itertools
import re
from collections.abc import Sequence
from dataclasses import dataclass

from bns.errors import FormatError
from bns.gap.importers.ros2_bag import Bag
from bns.gap.importers.ros2_messages import typed

STATE, TRAJECTORY, ARRAY = "JointState", "JointTrajectory", "Float64MultiArray"
COMMAND = re.compile(r"command|cmd|goal|desired|target|reference|setpoint|trajectory")
NEEDED = {
    "joint states": "record a topic of sensor_msgs/JointState",
    "commands": (
        "record a topic of trajectory_msgs/JointTrajectory, or one of JointState or "
        "Float64MultiArray whose name says command, goal, desired, target or the like"
    ),
}


@dataclass(frozen=True)
class _Topic:
    """A topic of joints: their names, if any, how many, and how many messages."""

    name: str
    joints: frozenset[str]
    size: int
    count: int

    def shares(self, other: "_Topic") -> int:
        """How many joints two topics have in common; all where names are missing."""
        if self.joints and other.joints:
            return len(self.joints & other.joints)
        return self.size if self.size == other.size else 0


def chosen(bag: Bag) -> tuple[str, str, tuple[str, ...]]:
    """The topics of states and of commands, and what was chosen there, in words.

    Of several the pair that has most joints in common; then the states with most joints
    and messages.

    Raises:
        FormatError: there is none, or two fit alike.
    """
    seen, told = _candidates(bag)
    if len(seen) == len(told) == 1:
        return seen[0], told[0], ()
    states, commands = _looked(bag, seen), _looked(bag, told)
    ranked = sorted(
        ((_rank(s, c), s.name, c.name) for s, c in itertools.product(states, commands)),
        reverse=True,
    )
    best, state, command = ranked[0]
    for rank, other, sent in ranked[1:]:
        if rank == best or (rank[0] == best[0] and sent != command):
            both = (state, other) if other != state else (command, sent)
            raise FormatError(_unsure(bag, both, (state, command)))
    left = sorted({*seen, *told} - {state, command})
    most = f", for they have {best[0]} joints in common" * bool(best[0])
    return (
        state,
        command,
        (f"topics: {state} and {command}{most}; left out: {', '.join(left)}",),
    )


def _candidates(bag: Bag) -> tuple[list[str], list[str]]:
    """Topics of states, and of commands.

    Raises:
        FormatError: there is none of a kind.
    """
    kinds = {name: schema.rpartition("/")[2] for name, schema in bag.topics.items()}
    told = [
        name
        for name, kind in kinds.items()
        if kind == TRAJECTORY
        or (kind in (STATE, ARRAY) and COMMAND.search(name.lower()))
    ]
    seen = [name for name, kind in kinds.items() if kind == STATE and name not in told]
    for found, what in ((seen, "joint states"), (told, "commands")):
        if not found:
            topics = sorted(bag.topics.items())
            there = ", ".join(f"{name} ({schema})" for name, schema in topics) or "none"
            raise FormatError(
                f"{bag.path} has no messages of {what}; its topics: {there}. "
                f"{NEEDED[what].capitalize()}."
            )
    return seen, told


def _looked(bag: Bag, names: Sequence[str]) -> list[_Topic]:
    """What topics hold, by their first messages."""
    made = []
    for name in names:
        ((_, first),) = typed(bag.messages({name})[name][:1], name, bag.path)
        size = max(len(values) for values in first.given.values())
        made.append(_Topic(name, frozenset(first.joints), size, bag.counts[name]))
    return made


def _rank(state: _Topic, command: _Topic) -> tuple[int, int, int]:
    return state.shares(command), state.size, state.count


def _unsure(bag: Bag, both: Sequence[str], best: Sequence[str]) -> str:
    """That two topics fit alike, and how to keep one of them."""
    files = [str(file) for file in bag.files]
    source = files[0] if len(files) == 1 else "FILE"
    each = " for each of its files" * (len(files) > 1)
    kept = " ".join(f"-y {name}" for name in best)
    return (
        f"{bag.path}: the topics {both[0]} and {both[1]} fit the robot alike. Keep one "
        f"of them, as by `mcap filter {source} -o one.mcap {kept}`{each}."
    )
