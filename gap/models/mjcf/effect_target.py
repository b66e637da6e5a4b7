"""A choice among the names of a model that is known later only."""

from dataclasses import dataclass

from bns.errors import BnsError
from bns.worlds.effects.base import Choice, Parameter

ALL = "all"
WIDE = 1e9  # bounds that a candidate narrows


@dataclass(frozen=True)
class Part(Choice):
    """A choice among the names of a model that is known later."""

    def check(self, effect: str, value: object) -> str:
        """The name as text.

        Raises:
            BnsError: it is empty or can not be written in text.
        """
        name = str(value)
        if not name or set(name) & set(",=:@%~ "):
            raise BnsError(f"{effect}:{self.name} = {value!r} names no part.")
        return name


PART = (Part("part", (ALL,), ALL, "name of the joint, body, actuator or channel"),)


def number(name: str, unit: str, nominal: float, doc: str) -> tuple[Parameter, ...]:
    low = 0.0 if nominal else -WIDE
    return (Parameter(name, unit, nominal, low, WIDE, doc, nominal + 1.0),)
