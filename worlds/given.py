"""Lamps, objects and rules from what a user may give for them."""

from collections.abc import Mapping, Sequence
from dataclasses import fields
from typing import TypeVar

from bns.errors import BnsError, UnknownNameError

T = TypeVar("T")


def several(kind: type[T], name: str, given: object) -> tuple[T, ...]:
    """One or more of a kind, each as itself or as a table with its fields.

    Args:
        kind: a dataclass.
        name: what one of it is called, for messages.
        given: one, or a sequence of them.

    Raises:
        BnsError: it is no such thing.
    """
    alone = isinstance(given, kind | Mapping) or not isinstance(given, Sequence)
    return tuple(one(kind, name, item) for item in ((given,) if alone else given))


def one(kind: type[T], name: str, given: object) -> T:
    """One of a kind, as itself or as a table with its fields; see `several`."""
    if isinstance(given, kind):
        return given
    known = [field.name for field in fields(kind)]
    if not isinstance(given, Mapping):
        raise BnsError(
            f"{given!r} is no {name}: give a {kind.__name__} or a table with "
            f"{', '.join(known)}."
        )
    for key in given:
        if key not in known:
            raise UnknownNameError(f"field of a {name}", str(key), known)
    try:
        return kind(**given)
    except TypeError as error:
        raise BnsError(f"{dict(given)!r} is no {name}: {error}.") from error
