"""Things that stand in the arena: robots bump into them, and they cast shadows."""

from collections.abc import Sequence
from dataclasses import dataclass, fields
from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.worlds.checks import bounded
from bns.worlds.effects.base import BodyEffect

HULL = (0.0035, 0.064, 0.031)
"""m; centre ahead of the axle, radius and half height of the robot's body (Webots)"""

_TOUCH = 2  # the bit of contype and conaffinity by which hull and objects meet

_BOUNDS = {  # low, high, unit; assumed: what a table top can hold
    "x": (-10.0, 10.0, "m"),
    "y": (-10.0, 10.0, "m"),
    "radius": (0.001, 2.0, "m"),
    "height": (0.001, 5.0, "m"),
}


@dataclass(frozen=True)
class Post:
    """A round thing that stands on the floor and does not move.

    Attributes:
        x, y: where its axis is, in the world frame [m].
        radius: [m].
        height: [m].

    Raises:
        OutOfBoundsError: a number outside its bounds.
    """

    x: float
    y: float
    radius: float = 0.05
    height: float = 0.3

    def __post_init__(self) -> None:
        for item in fields(self):
            low, high, unit = _BOUNDS[item.name]
            value = bounded(
                f"object {item.name}", getattr(self, item.name), low, high, unit
            )
            object.__setattr__(self, item.name, value)


class Objects(BodyEffect):
    """Puts things into a robot's scene, and a hull around the robot to bump with.

    No effect that a user can name: a part of the world that is written into its model
    as effects are.
    """

    name = "objects"
    doc = "things stand in the arena"

    def __init__(self, posts: Sequence[Post]):
        self.values = {"posts": tuple(posts)}
        self._posts: tuple[Post, ...] = tuple(posts)

    def edit(self, spec: Any) -> None:
        """Add the objects and the hull."""
        for body in spec.bodies[1:]:
            if body.parent == spec.worldbody:
                self._hull(body)
        stand(spec, self._posts)

    def _hull(self, body: Any) -> None:
        import mujoco

        ahead, radius, half = HULL
        hull = body.add_geom(name="hull", type=mujoco.mjtGeom.mjGEOM_CYLINDER)
        hull.pos, hull.size = [ahead, 0, 2 * half], [radius, half, 0]
        hull.pos[2] = 0.008 + half  # [m] clear of the floor
        hull.mass, hull.group = 0, 3
        hull.contype, hull.conaffinity = _TOUCH, 0


def stand(spec: Any, posts: Sequence[Post]) -> None:
    """Add the objects alone to a `mujoco.MjSpec`."""
    import mujoco

    for number, post in enumerate(posts):
        geom = spec.worldbody.add_geom(name=f"object_{number}")
        geom.type = mujoco.mjtGeom.mjGEOM_CYLINDER
        geom.pos = [post.x, post.y, post.height / 2]
        geom.size = [post.radius, post.height / 2, 0]
        geom.contype, geom.conaffinity = 0, _TOUCH
        geom.rgba = [0.45, 0.47, 0.5, 1.0]


class RayScreen:
    """What objects leave of the lamps' light, by rays in MuJoCo.

    Args:
        posts: the objects.
    """

    def __init__(self, posts: Sequence[Post]):
        import mujoco

        spec = mujoco.MjSpec()
        stand(spec, posts)
        self._cast, self._far = mujoco.mj_multiRay, mujoco.mjMAXVAL
        self._model = spec.compile()
        self._data = mujoco.MjData(self._model)
        mujoco.mj_forward(self._model, self._data)

    def __call__(self, points: np.ndarray, lamps: np.ndarray) -> np.ndarray:
        """1 where a lamp is seen from a point, else 0.

        Args:
            points: shape ``(n, S, 3)`` [m].
            lamps: shape ``(n, L, 3)`` [m].
        """
        seen = np.ones((*points.shape[:2], lamps.shape[1]))
        for at in range(lamps.shape[1]):
            places, of = np.unique(lamps[:, at], axis=0, return_inverse=True)
            for number, place in enumerate(places):
                robots = of.ravel() == number
                seen[robots, :, at] = self._from(place, points[robots])
        return seen

    def _from(self, lamp: np.ndarray, points: np.ndarray) -> np.ndarray:
        way = np.ascontiguousarray((points - lamp).reshape(-1, 3))
        length = np.maximum(np.linalg.norm(way, axis=1), 1e-6)
        way /= length[:, None]
        hit, distance = np.empty(len(way), np.int32), np.empty(len(way))
        self._cast(
            self._model, self._data, lamp, way.ravel(), None, 1, -1, hit, distance,
            None, len(way), self._far,
        )  # fmt: skip
        blocked = (hit >= 0) & (distance < length)
        return np.where(blocked, 0.0, 1.0).reshape(points.shape[:2])


def checked(
    posts: Sequence[Post], lamps: np.ndarray, starts: np.ndarray, radius: float
) -> None:
    """Stop if an object stands on a lamp or a robot starts in one.

    Args:
        posts: the objects.
        lamps: where the lamps are, ``(L, 2)`` [m].
        starts: of the robots, ``(n, 3)``.
        radius: of a robot [m].

    Raises:
        BnsError: it is so.
    """
    for number, post in enumerate(posts):
        centre = np.array([post.x, post.y])
        for name, places, room in (("lamp", lamps, 0.0), ("start", starts, radius)):
            way = np.hypot(*(places[:, :2] - centre).T)
            if len(way) and way.min() < post.radius + room:
                raise BnsError(
                    f"Object {number} at ({post.x:g}, {post.y:g}) stands on "
                    f"{name} {int(way.argmin())}; put it elsewhere."
                )
