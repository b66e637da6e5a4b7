"""Tags: on a robot's back, on the floor, in pictures."""

from dataclasses import dataclass, field
from typing import Any

import numpy as np

from bns.hardware.tracking.camera import cv2

DICTIONARY = "DICT_4X4_50"
CELLS = 6  # a side of a 4 x 4 tag, with its black border


@dataclass(frozen=True)
class Marker:
    """A square tag of OpenCV's 4 x 4 dictionary.

    Attributes:
        number: in the dictionary.
        side: of its black square [m].
        height: above the board [m]; a wrong one shifts every position.
        x, y: of its centre in the robot's frame [m].
        yaw: direction of its upper edge in the robot's frame [rad].
    """

    number: int = 0
    side: float = 0.080
    height: float = 0.0717
    x: float = 0.0
    y: float = 0.0
    yaw: float = 0.0

    def corners(self) -> np.ndarray:
        """Its corners in the robot's frame, ``(4, 2)`` [m], in OpenCV's order.

        Upper left, upper right, lower right, lower left of the printed tag; its upper
        edge is ahead.
        """
        half = self.side / 2
        own = np.array([[half, half], [half, -half], [-half, -half], [-half, half]])
        cos, sin = np.cos(self.yaw), np.sin(self.yaw)
        return own @ np.array([[cos, sin], [-sin, cos]]) + (self.x, self.y)


MARKERS = {
    "khepera3": Marker(),
    "phantomx": Marker(number=1, side=0.100, height=0.1518),
}
"""robot -> its tag; the hexapod's is 0.06 m above its hips (assumed), which stand
0.0918 m high; that changes with the gait, 10 mm shift a place by 5 mm at the edge"""


@dataclass(frozen=True)
class Floor:
    """Tags that lie on the board, for the place of the camera.

    Attributes:
        side: of each [m].
        places: number -> x, y of its centre [m] and the direction of its upper edge
            [rad]. Lay them askew: an edge along the camera's rows is found a share of
            a pixel off, the same all along.
    """

    side: float = 0.120
    places: dict[int, tuple[float, float, float]] = field(
        default_factory=lambda: {
            10: (-1.2, -0.75, 0.35), 11: (0.0, -0.75, 0.55), 12: (1.2, -0.75, 0.25),
            13: (-1.2, 0.75, 0.45), 14: (0.0, 0.75, 0.30), 15: (1.2, 0.75, 0.60),
        }
    )  # fmt: skip

    def corners(self) -> dict[int, np.ndarray]:
        """Corners of each tag in the world, ``(4, 3)`` [m], in OpenCV's order."""
        return {
            number: np.column_stack(
                [Marker(number, self.side, 0.0, x, y, yaw).corners(), np.zeros(4)]
            )
            for number, (x, y, yaw) in self.places.items()
        }


def dictionary() -> object:
    """OpenCV's dictionary of tags."""
    module = cv2()
    return module.aruco.getPredefinedDictionary(getattr(module.aruco, DICTIONARY))


def picture(number: int, *, cell: int = 40, border: float = 1.0) -> np.ndarray:
    """A tag as an image with a white border, uint8.

    Args:
        number: in the dictionary.
        cell: pixels of a cell.
        border: of white around it, in cells.

    Returns:
        ``(N, N)``, 0 black, 255 white.
    """
    tag = cv2().aruco.generateImageMarker(dictionary(), number, cell * CELLS)
    return np.pad(tag, round(cell * border), constant_values=255)


REACH = 1.6  # half a window, in sides of the tag
ENLARGED = 3
"""times that a window is enlarged before its corners are refined: an edge along the
rows of the picture is else found up to half a pixel off, the same all along"""
SHIFT = 0.5
"""px by which OpenCV's AprilTag refinement is off in x and y"""


class Finder:
    """Finds tags. Fine corners come from OpenCV's AprilTag refinement, in a window:
    in a whole picture it takes most of a second.
    """

    def __init__(self) -> None:
        self._wide: Any = None
        self._fine: dict[int, Any] = {}

    def anywhere(self, image: np.ndarray) -> dict[int, np.ndarray]:
        """All tags of a picture: number -> corners ``(4, 2)`` [px], fine ones.

        A number that is seen twice is left out.
        """
        if self._wide is None:
            self._wide = _detector(max(image.shape))
        coarse = _found(self._wide, image)
        fine = {}
        for number, corners in coarse.items():
            side = float(np.linalg.norm(corners - np.roll(corners, 1, 0), axis=1).max())
            again = self.window(image, corners.mean(0), side, number)
            fine[number] = corners if again is None else again
        return fine

    def window(
        self, image: np.ndarray, at: np.ndarray, side: float, number: int
    ) -> np.ndarray | None:
        """Corners ``(4, 2)`` [px] of a tag around a place, None where it is not.

        Args:
            image: whole picture.
            at: where to look [px].
            side: of the tag [px], about.
            number: of the tag.
        """
        half = int(REACH * side) + 2
        left, top = (max(int(v) - half, 0) for v in at)
        part = image[top : max(int(at[1]) + half, 0), left : max(int(at[0]) + half, 0)]
        if not part.size or min(part.shape) < side:
            return None
        module = cv2()
        large = module.resize(
            part, None, fx=ENLARGED, fy=ENLARGED, interpolation=module.INTER_CUBIC
        )
        width = max(large.shape)
        if width not in self._fine:
            self._fine[width] = _detector(width, side=side * ENLARGED)
        found = _found(self._fine[width], large).get(number)
        if found is None:
            return None
        return (found - SHIFT + 0.5) / ENLARGED - 0.5 + np.array([left, top])


def _detector(width: int, *, side: float = 0.0) -> Any:
    """OpenCV's detector: coarse for whole pictures, fine where a side [px] is given."""
    aruco = cv2().aruco
    settings = aruco.DetectorParameters()
    settings.minMarkerPerimeterRate = 0.02
    settings.cornerRefinementMethod = aruco.CORNER_REFINE_SUBPIX
    settings.cornerRefinementWinSize = 3
    if side:
        settings.cornerRefinementMethod = aruco.CORNER_REFINE_APRILTAG
        # relative to the longer side: small shapes in a noisy window cost time
        settings.minMarkerPerimeterRate = 2.0 * side / width
    return aruco.ArucoDetector(dictionary(), settings)


def _found(detector: Any, image: np.ndarray) -> dict[int, np.ndarray]:
    corners, numbers, _ = detector.detectMarkers(np.ascontiguousarray(image))
    if numbers is None:
        return {}
    flat = numbers.ravel().tolist()
    return {
        number: item[0].astype(np.float64)
        for number, item in zip(flat, corners, strict=True)
        if flat.count(number) == 1
    }
