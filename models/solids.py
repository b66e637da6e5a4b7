"""Inertias of solids of even density."""

from collections.abc import Sequence


def box(mass: float, sides: Sequence[float]) -> list[float]:
    """About the axes through a box's middle [kg m2].

    Args:
        mass: [kg].
        sides: its length, width and height [m].
    """
    squares = [side * side for side in sides]
    return [mass / 12 * (sum(squares) - square) for square in squares]
