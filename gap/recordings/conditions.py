"""Numbers among the conditions of a trial, which a file may hold as anything."""

from collections.abc import Mapping
from typing import SupportsFloat

from bns.errors import FormatError


def as_number(
    conditions: Mapping[str, object], name: str, default: float = 0.0
) -> float:
    """A condition that is a number.

    Args:
        conditions: of a trial, by name.
        name: of the condition.
        default: where the trial has no such condition.

    Raises:
        FormatError: it is no number.
    """
    value = conditions.get(name, default)
    if isinstance(value, str | SupportsFloat):
        try:
            return float(value)
        except ValueError:
            pass
    raise FormatError(f"Condition {name!r} of a trial is {value!r}; give a number.")
