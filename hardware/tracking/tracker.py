"""From pictures to poses: the tag is found, its corners put on its own plane."""

from dataclasses import dataclass, replace
from typing import NamedTuple

import numpy as np

from bns.hardware.tracking.camera import Camera, plane_points
from bns.hardware.tracking.marker import Finder, Marker

CROOKED = 0.12  # share of its side by which a seen side may differ: else no tag
LEANING = 0.40  # the same of a robot that may lean, by 50 deg at most
TURN = 2 * np.pi


class Frame(NamedTuple):
    """One picture.

    Attributes:
        time: when it was taken [s], the session's clock.
        image: grey values, shape ``(height, width)``, uint8.
        number: counted from 0; a gap is a lost picture.
    """

    time: float
    image: np.ndarray
    number: int


class Sighting(NamedTuple):
    """The robot in one picture.

    Attributes:
        time: when the picture was taken [s].
        pose: (x, y, yaw) of the robot in the world frame [m, m, rad]; yaw continuous.
        side: of the tag as seen on its plane [m]: larger than printed where the tag
            is higher than it was said to be.
        repeated: the picture is the one before it to the last bit, which no camera
            gives twice: it hangs, and the robot may be anywhere.
    """

    time: float
    pose: np.ndarray
    side: float
    repeated: bool = False


@dataclass(frozen=True)
class Loss:
    """How many pictures had the tag in them."""

    seen: int = 0
    missed: int = 0


class Tracker:
    """Finds one tag in pictures of a calibrated camera.

    It looks around the last place first and in the whole picture where it is not
    there.

    Args:
        camera: calibrated.
        marker: on the robot.
        crooked: share by which a side may be off its length; else it is no tag.

    Attributes:
        loss: pictures with and without the tag.
    """

    def __init__(self, camera: Camera, marker: Marker, *, crooked: float = CROOKED):
        self.camera, self.marker, self.crooked = camera, marker, crooked
        self.loss = Loss()
        self._finder = Finder()
        self._last: Sighting | None = None
        self._image: np.ndarray | None = None
        local = marker.corners()
        self._ahead = local[[0, 1]].mean(0) - local[[2, 3]].mean(0)
        self._middle = local.mean(0)

    def see(self, frame: Frame) -> Sighting | None:
        """The robot in a picture, None where the tag is not in it."""
        corners = self._around(frame.image)
        if corners is None:
            corners = self._finder.anywhere(frame.image).get(self.marker.number)
        sighting = self._posed(frame.time, corners) if corners is not None else None
        before, self._image = self._image, frame.image
        loss = self.loss
        if sighting is None:
            self.loss = replace(loss, missed=loss.missed + 1)
            return None
        self.loss = replace(loss, seen=loss.seen + 1)
        if before is not None and np.array_equal(before, frame.image):
            sighting = sighting._replace(repeated=True)
        self._last = sighting
        return sighting

    def _posed(self, time: float, corners: np.ndarray) -> Sighting | None:
        places = self.camera.on_plane(corners, self.marker.height)
        sides = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
        if np.abs(sides / self.marker.side - 1).max() > self.crooked:
            return None
        ahead = places[[0, 1]].mean(0) - places[[2, 3]].mean(0)
        yaw = np.arctan2(ahead[1], ahead[0]) - np.arctan2(
            self._ahead[1], self._ahead[0]
        )
        before = self._last.pose[2] if self._last else 0.0
        yaw -= TURN * np.rint((yaw - before) / TURN)
        cos, sin = np.cos(yaw), np.sin(yaw)
        x, y = self._middle
        centre = places.mean(0) - (cos * x - sin * y, sin * x + cos * y)
        return Sighting(time, np.array([*centre, yaw]), float(sides.mean()))

    def _around(self, image: np.ndarray) -> np.ndarray | None:
        """Corners near the last place ``(4, 2)``, None where there are none."""
        if self._last is None:
            return None
        middle = plane_points(
            self._last.pose, np.array([self._middle]), self.marker.height
        )
        at = self.camera.project(middle)[0]
        focal, depth = self.camera.matrix[0, 0], self.camera.position[2]
        side = float(focal * self.marker.side / (depth - self.marker.height))
        return self._finder.window(image, at, side, self.marker.number)

    def missed(self) -> None:
        """Note a picture that did not come."""
        self.loss = replace(self.loss, missed=self.loss.missed + 1)
