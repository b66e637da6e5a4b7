"""Legs and servos of a walking robot: how effects name and find them.

Legs have numbers and names (`bns.models.legs`). Sets of legs are written
``1,5``, ``left_front+left_middle`` or, by the number of a damage type, ``type4``.
"""

from collections.abc import Iterable, Iterator
from dataclasses import dataclass
from itertools import combinations
from typing import Any

from bns.errors import BnsError, UnknownNameError
from bns.models.legs import JOINTS, LEGS, PARTS, present
from bns.worlds.effects.parameter import Choice

ALL = "all"

TYPES: dict[int, tuple[int, ...]] = {
    0: (1,), 1: (5,), 2: (1, 2), 3: (5, 6), 4: (1, 5), 5: (1, 4), 6: (1, 6),
    7: (1, 3, 5), 8: (1, 5, 6), 9: (1, 2, 4), 10: (1, 4, 5), 11: (1, 3, 6),
    12: (1, 3, 4, 5), 13: (1, 3, 5, 6), 14: (1, 4, 5, 6), 15: (1, 3, 4, 6),
    16: (1, 3), 17: (1, 2, 5), 18: (1, 2, 3, 4), 19: (1, 2, 5, 6),
}  # fmt: skip
"""Damage types: 0 to 15 of the dissertation's table 7.1, and the four classes of one to
four legs under its left-right and front-back symmetry that the table lacks."""


def named(effect: Any) -> frozenset[int]:
    """Legs that an effect's choices name one by one; "all" names none."""
    found: set[int] = set()
    for choice in effect.choices:
        value = str(effect[choice.name])
        if choice.name == "legs" and value != ALL:
            found.update(read(value))
        elif choice.name in ("servo", "joint"):
            found.update(present([value, f"{value}_"]))
    return frozenset(found)


def joints_named(effect: Any) -> frozenset[str]:
    """Parts and joints that an effect's choices name, "coxa" or "left_front_coxa"."""
    values = (str(effect[choice.name]) for choice in effect.choices)
    return frozenset(value for value in values if value in (*PARTS, *JOINTS))


def text(legs: Iterable[int]) -> str:
    """A set of legs as text, ``1,5``."""
    return ",".join(str(leg) for leg in sorted(set(legs)))


def mirrored(legs: Iterable[int]) -> tuple[int, ...]:
    """The same legs on the other side."""
    return tuple(sorted(leg + 1 if leg % 2 else leg - 1 for leg in legs))


def subsets(fewest: int = 1, most: int = 4) -> tuple[tuple[int, ...], ...]:
    """Sets of legs that no left-right mirror image repeats, smallest first.

    One to four legs give the thirty-one classes of a robot that walks in a direction.
    """
    found: list[tuple[int, ...]] = []
    for count in range(fewest, most + 1):
        for legs in combinations(range(1, 7), count):
            if mirrored(legs) not in found:
                found.append(legs)
    return tuple(found)


def read(given: str) -> tuple[int, ...]:
    """A set of legs from text, in order; "all" are all of them.

    Raises:
        UnknownNameError: no such leg or damage type.
        BnsError: all six legs one by one.
    """
    if given == ALL:
        return tuple(range(1, len(LEGS) + 1))
    words = str(given).replace("+", ",").split(",")
    legs: set[int] = set()
    for word in (item.strip() for item in words):
        if word in LEGS:
            legs.add(LEGS.index(word) + 1)
        elif word in _NUMBERS:
            legs.add(int(word))
        elif word[:4] == "type" and word[4:].isdecimal() and int(word[4:]) in TYPES:
            legs.update(TYPES[int(word[4:])])
        else:
            raise UnknownNameError("leg", word, (*_NUMBERS, *LEGS, "type0 to type19"))
    if len(legs) == len(LEGS):
        raise BnsError(f"Legs {given!r} are all of them: leave the robot one at least.")
    return tuple(sorted(legs))


_NUMBERS = tuple(str(number) for number in range(1, 7))


@dataclass(frozen=True)
class LegSet(Choice):
    """A choice of one to five legs; whatever way it is written, it becomes ``1,5``.

    Attributes:
        whole: whether "all" is allowed as well.
    """

    whole: bool = False

    @property
    def shown(self) -> str:
        """The alternatives for a listing."""
        ways = "1 to 6 as 1,5; names as left_front+left_middle; type0 to type19"
        return f"{ways}; {ALL}" if self.whole else ways

    def check(self, effect: str, value: object) -> str:
        """The legs as text, in order.

        Raises:
            UnknownNameError: no such leg or damage type.
            BnsError: all six legs.
        """
        if value == ALL and self.whole:
            return ALL
        if value == ALL:
            raise BnsError(f"{effect}: {ALL} legs are too many: leave the robot one.")
        return text(read(str(value)))


_SETS = tuple(text(legs) for n in range(1, 6) for legs in combinations(range(1, 7), n))
LEG_SET = LegSet("legs", _SETS, "1", "which legs")
LEGS_OR_ALL = LegSet("legs", (*_SETS, ALL), ALL, "which legs", whole=True)

SERVO = Choice(
    "servo",
    ("all", *PARTS, *LEGS, *JOINTS),
    "all",
    "which servos of a walking robot: a joint's, a leg's, one of each leg, or all",
    quiet=True,
)
JOINT = Choice("joint", JOINTS, JOINTS[1], "which joint")


def chosen(spec: Any, which: str) -> Iterator[Any]:
    """Actuators of an `MjSpec` that a value of the choice `servo` names."""
    for actuator in spec.actuators:
        joint = actuator.target
        leg, _, part = joint.rpartition("_")
        if which in ("all", joint, leg, part):
            yield actuator


def bodies(spec: Any, legs: str, part: str) -> Iterator[Any]:
    """One part's bodies of a set of legs (text), of those that an `MjSpec` has.

    Args:
        spec: a `mujoco.MjSpec`.
        legs: a set of legs as text, see `read`.
        part: end of the bodies' names, such as "tibia".
    """
    for leg in read(legs):
        body = spec.body(f"{LEGS[leg - 1]}_{part}")
        if body is not None:
            yield body


def shins(spec: Any, legs: str) -> Iterator[Any]:
    """The outermost bodies of a set of legs (text), which the feet are part of."""
    for leg in map(str, read(legs)):
        yield from list(bodies(spec, leg, "tibia")) or bodies(spec, leg, "femur")
