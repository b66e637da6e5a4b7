"""The tag on a robot's back and those on the floor."""

from dataclasses import dataclass, field

import numpy as np

from bns.hardware.tracking.opencv import cv2

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
