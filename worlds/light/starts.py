"""Where robots start on a board with lamps."""

from collections.abc import Iterable

import numpy as np

from bns.errors import BnsError

NEAREST = 0.5
"""m; trials start no nearer to a lamp than this; assumed"""

TRIES = 10_000


def anywhere(
    rng: np.random.Generator,
    arena: tuple[float, float],
    lamps: np.ndarray,
    *,
    edge: float = 0.0,
    taken: Iterable[tuple[float, float, float]] = (),
) -> tuple[float, float, float]:
    """A pose anywhere on the board, but not near a lamp, the edge or what is taken.

    Args:
        rng: the only source of randomness.
        arena: size of the board [m], its centre the origin.
        lamps: where the lamps are, shape ``(L, 2)`` [m].
        edge: kept free along the board's edge [m]; negative = nothing.
        taken: other places: x, y and what to keep free around them [m].

    Returns:
        x, y, yaw [m, m, rad].

    Raises:
        BnsError: there is no such place.
    """
    half = np.asarray(arena) / 2 - max(edge, 0.0)
    x, y, room = np.array([*((*place, NEAREST) for place in lamps), *taken]).T
    for _ in range(TRIES):
        place = rng.uniform(-half, half)
        if (np.hypot(x - place[0], y - place[1]) > room).all():
            return (*place.tolist(), float(rng.uniform(-np.pi, np.pi)))
    raise BnsError(
        f"There is no place on the board {NEAREST} m away from every lamp; give "
        "starts, or fewer lamps."
    )
