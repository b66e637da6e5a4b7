"""What the legs of a walking robot and their joints are called.

Legs have numbers (the dissertation's, figure 7.2) and names; a robot with fewer than
six has some of them. A joint is called after leg and part, "left_front_femur". Legs of
two joints have a coxa and a femur, or a femur and a tibia.
"""

from collections.abc import Iterable

LEGS = (
    "left_front",
    "right_front",
    "left_rear",
    "right_rear",
    "left_middle",
    "right_middle",
)
"""by number, 1 to 6"""

PARTS = ("coxa", "femur", "tibia")
"""from the body outwards"""

JOINTS = tuple(f"{leg}_{part}" for leg in LEGS for part in PARTS)


def names(joints: Iterable[str]) -> tuple[str, ...]:
    """The legs that a robot has, from the names of its joints."""
    legs = {joint.rpartition("_")[0] for joint in joints}
    return tuple(leg for leg in LEGS if leg in legs)


def parts(joints: Iterable[str]) -> tuple[str, ...]:
    """The parts that move in a robot's legs, from the names of its joints."""
    moved = {joint.rpartition("_")[2] for joint in joints}
    return tuple(part for part in PARTS if part in moved)


def joints_of(leg: str, joints: Iterable[str]) -> tuple[str, ...]:
    """Those joints that are a leg's, in their order."""
    return tuple(joint for joint in joints if joint.rpartition("_")[0] == leg)


def present(joints: Iterable[str]) -> tuple[int, ...]:
    """The same by number."""
    return tuple(LEGS.index(leg) + 1 for leg in names(joints))
