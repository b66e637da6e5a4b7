"""What the TOML file of a route says: its objectives, and in which order they are."""

from typing import Any

from bns.errors import FormatError, OutOfBoundsError, UnknownNameError
from bns.experiment.task_settings import TaskConfig
from bns.tasks import registry
from bns.tasks.base import BOARD

KIND = "navigation"


def order(name: str) -> str:
    """Letters of a task's objectives, in the order in which they are to be reached.

    Raises:
        UnknownNameError: no such task, or not one of navigation.
        FormatError: its file gives no text as `order`.
    """
    content = registry.content(name)
    if "order" not in content and content["kind"] != KIND:
        routes = [n for n in registry.readable() if "order" in registry.content(n)]
        raise UnknownNameError("navigation task", name, routes)
    given = content.get("order", "")
    if not isinstance(given, str) or not given:
        raise FormatError(
            f"Task {name!r}: order = {given!r} is not allowed: give the objectives' "
            'letters as one text, as order = "ABCDA".'
        )
    return given


def objectives(config: TaskConfig) -> dict[str, tuple[float, float]]:
    """Positions of a task's objectives on the board [m], the centre E the origin.

    The dissertation gives them in a picture only; the corners are an assumption:
    A bottom right, B bottom left, C top left, D top right. A task's file may place
    its own.

    Raises:
        UnknownNameError: no such task.
        FormatError: its file places objectives otherwise than as LETTER = [x, y].
        OutOfBoundsError: an objective off the board.
    """
    own = registry.content(config.name).get("objectives")
    if own is not None:
        return _placed(config.name, own)
    x, y = config.corner_x, config.corner_y
    return {"A": (x, -y), "B": (-x, -y), "C": (-x, y), "D": (x, y), "E": (0.0, 0.0)}


def _placed(name: str, own: Any) -> dict[str, tuple[float, float]]:
    """Objectives of a task's file, see `objectives`."""
    if not isinstance(own, dict) or not own:
        raise FormatError(
            f"Task {name!r}: objectives = {own!r} is not allowed: give a table of "
            "letters, as A = [0.4, -0.2]."
        )
    for letter in own:
        if len(letter) != 1:
            raise FormatError(
                f"Task {name!r}: objectives.{letter} is not allowed: an objective is "
                "called by one letter, as order has them."
            )
    return {
        letter: on_board(name, f"objectives.{letter}", at) for letter, at in own.items()
    }


def on_board(name: str, key: str, given: Any) -> tuple[float, float]:
    """A place on the board [m] from a task's file.

    Args:
        name: of the task.
        key: of the file that gives it, for messages.
        given: what it gives, to be two numbers.

    Raises:
        FormatError: not two numbers.
        OutOfBoundsError: off the board.
    """
    numbers = isinstance(given, list) and all(type(n) in (int, float) for n in given)
    if not numbers or len(given) != 2:
        raise FormatError(
            f"Task {name!r}: {key} = {given!r} is not allowed: give two numbers, its "
            "x and y from the board's centre [m]."
        )
    for axis, value, half in zip("xy", given, BOARD, strict=True):
        if not abs(value) <= half:
            what = f"Task {name!r}: {axis} of {key}"
            raise OutOfBoundsError(what, value, -half, half, "m")
    return float(given[0]), float(given[1])


def stops(config: TaskConfig) -> list[tuple[float, float]]:
    """Positions of the objectives in the order in which they are to be reached [m].

    Raises:
        UnknownNameError: no such task, or a letter in its order that has no place.
        BnsError: as `order` and `objectives`.
    """
    places = objectives(config)
    for letter in order(config.name):
        if letter not in places:
            kind = f"objective in the order of the task {config.name!r}"
            also = f"Place it in [objectives]: {letter} = [x, y] in m."
            raise UnknownNameError(kind, letter, places, also)
    return [places[letter] for letter in order(config.name)]
