"""Tags in pictures: coarse in a whole picture, fine in a window."""

from typing import Any

import numpy as np

from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.opencv import cv2

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
    return aruco.ArucoDetector(tags.dictionary(), settings)


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
