"""The way to a place on the board, round the lamps."""

from collections.abc import Sequence

import numpy as np

WIDER = 1.25  # share of the distance to keep at which the way turns; assumed
CORNERS = 8  # at most


def around(
    begin: np.ndarray,
    end: Sequence[float] | np.ndarray,
    lamps: np.ndarray,
    *,
    keep: float,
) -> list[np.ndarray]:
    """Places to pass on the way from one place to another.

    A straight way that comes nearer than `keep` to a lamp gets a corner beside it; a
    way that begins nearer leads straight away from the lamp first.

    Args:
        begin, end: of the way, ``(2,)`` [m]; the end no nearer to a lamp than `keep`.
        lamps: where they stand, ``(L, 2)`` [m].
        keep: distance to keep [m].

    Returns:
        Corners ``(2,)`` [m] in order, without begin and end.
    """
    here, goal = np.array(begin, float), np.asarray(end, float)
    made: list[np.ndarray] = []
    while len(made) < CORNERS:
        lamp = _nearest(here, goal, lamps, keep)
        if lamp is None:
            break
        here = _beside(here, goal, lamp, keep)
        made.append(here)
    return made


def _nearest(
    here: np.ndarray, goal: np.ndarray, lamps: np.ndarray, keep: float
) -> np.ndarray | None:
    """The first lamp that the straight way comes too near to, if any."""
    way = goal - here
    length = max(float(way @ way), 1e-12)
    at = np.clip((lamps - here) @ way / length, 0.0, 1.0)
    apart = np.hypot(*(here + at[:, None] * way - lamps).T)
    near = np.flatnonzero(apart < keep * (1 - 1e-9))
    return lamps[near[at[near].argmin()]] if len(near) else None


def _beside(
    here: np.ndarray, goal: np.ndarray, lamp: np.ndarray, keep: float
) -> np.ndarray:
    """A corner that leads out of a lamp's reach, or some way round it."""
    out = here - lamp
    far = float(np.hypot(*out))
    if far < keep:  # straight away from it
        ahead = out / far if far > 1e-9 else np.array([1.0, 0.0])
        return lamp + WIDER * keep * ahead
    angle = np.arctan2(out[1], out[0])
    aim = np.arctan2(goal[1] - lamp[1], goal[0] - lamp[0])
    off = (aim - angle + np.pi) % (2 * np.pi) - np.pi
    turn = np.sign(off) * min(abs(off), np.pi / 3)
    return lamp + WIDER * keep * np.array([np.cos(angle + turn), np.sin(angle + turn)])
