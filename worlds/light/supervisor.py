"""Who watches over robots that steer themselves: at the edge and near a lamp.

Investigations B and C: a robot that comes closer to the lamp than the safety boundary
is stopped for good (5.2.3), and at the edge of the arena it is turned to a random
heading towards the centre and goes on. Both are done by hand or by the tracking
system: the robot stands, is turned where it stands, and the cycle is lost.
"""

import math
from dataclasses import dataclass
from typing import NamedTuple

import numpy as np

from bns.errors import UnknownNameError
from bns.worlds.checks import bounded

SPREAD = np.pi / 4
"""rad; a turned robot looks within this of the centre (or away from the lamp); assumed
"""

PERIOD = 0.1
"""s; how often the tracking system looks; assumed"""

DEEPER = 1e-4  # [m] a robot on its way out is left alone; assumed


class Call(NamedTuple):
    """Where a robot has to be stopped.

    Attributes:
        look: index of the look at which it is.
        reason: "edge" or "lamp".
        lamp: which lamp; -1 at the edge.
    """

    look: int
    reason: str
    lamp: int = -1


@dataclass(frozen=True)
class Supervisor:
    """The rules.

    Attributes:
        safety: a robot whose centre is nearer to a lamp is stopped [m]; 0 = never.
            The dissertation gives no number; assumed.
        at_lamp: "stop" = for the rest of the trial, "turn" = turned away, goes on.
        edge: a robot whose centre is nearer to the board's edge is turned [m];
            negative = it may leave. Assumed: its own radius and a margin.

    Raises:
        OutOfBoundsError, UnknownNameError: a value that is not allowed.
    """

    safety: float = 0.15
    at_lamp: str = "stop"
    edge: float = 0.08

    def __post_init__(self) -> None:
        bounded("safety boundary", self.safety, 0.0, 10.0, "m")
        bounded("edge margin", self.edge, -100.0, 10.0, "m")
        if self.at_lamp not in ("stop", "turn"):
            raise UnknownNameError("at_lamp", str(self.at_lamp), ("stop", "turn"))

    def calls(
        self, places: np.ndarray, lamps: np.ndarray, arena: tuple[float, float]
    ) -> dict[int, Call]:
        """The robots that have to be stopped, and where.

        Args:
            places: where each is at each look, shape ``(n, looks, 2)`` [m]; the first
                look is that before.
            lamps: where the lamps are, shape ``(L, 2)`` [m].
            arena: size of the board [m].

        Returns:
            The first call for each robot that has one. Robots on their way out are
            left alone.
        """
        depth = np.empty((*places.shape[:2], 1 + len(lamps)))  # [m]
        x, y = np.moveaxis(np.abs(places), -1, 0)
        half_x, half_y = arena[0] / 2 - self.edge, arena[1] / 2 - self.edge
        np.maximum(x - half_x, y - half_y, out=depth[..., 0])
        way = places[:, :, None] - lamps
        np.hypot(way[..., 0], way[..., 1], out=depth[..., 1:])
        np.subtract(self.safety, depth[..., 1:], out=depth[..., 1:])
        if not (depth > 0).any():
            return {}
        deeper = (depth[:, 1:] > 0) & (depth[:, 1:] - depth[:, :-1] > DEEPER)
        robots = np.flatnonzero(deeper.any(axis=(1, 2))).tolist()
        return {robot: self._first(deeper[robot]) for robot in robots}

    def _first(self, deeper: np.ndarray) -> Call:
        look = int(deeper.any(axis=1).argmax())
        which = int(deeper[look].nonzero()[0][-1])  # a lamp before the edge
        return Call(look + 1, "lamp" if which else "edge", which - 1)

    def heading(
        self,
        place: np.ndarray,
        lamp: np.ndarray | None,
        rng: np.random.Generator,
    ) -> float:
        """Where a turned robot looks [rad].

        Args:
            place: where it stands [m].
            lamp: the lamp that it is turned away from; None = towards the centre.
            rng: the only source of randomness.
        """
        way = -place if lamp is None else place - lamp
        return math.atan2(way[1], way[0]) + rng.uniform(-SPREAD, SPREAD)
