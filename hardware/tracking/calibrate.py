"""Calibration: the lens from a board of squares, the camera's place from floor tags,
the height of the robot's tag from its size.
"""

from collections.abc import Sequence
from typing import Any, NamedTuple

import numpy as np

from bns.errors import BnsError
from bns.hardware.tracking.camera import Camera, cv2
from bns.hardware.tracking.marker import Finder, Floor, Marker, dictionary
from bns.hardware.tracking.tracker import Sighting

LEAST_VIEWS = 8  # of the board of squares; 15 to 20 are better
LEAST_TAGS = 4  # on the floor
TOLERANCE = 0.010  # m by which the tag's height may be off; a wrong one shifts poses


class Lens(NamedTuple):
    """Intrinsics of a camera.

    Attributes:
        size: width and height [px].
        matrix: ``(3, 3)`` [px].
        distortion: ``(5,)``.
        error: root mean square of what is left [px].
    """

    size: tuple[int, int]
    matrix: np.ndarray
    distortion: np.ndarray
    error: float


class Height(NamedTuple):
    """What the size of the robot's tag says of its height.

    Attributes:
        height: above the board [m].
        error: standard error [m].
        said: what the settings say [m].
    """

    height: float
    error: float
    said: float

    @property
    def agrees(self) -> bool:
        """Whether the settings are right within the tolerance."""
        return abs(self.height - self.said) <= TOLERANCE + 2 * self.error


def squares(columns: int = 8, rows: int = 6, *, side: float = 0.04) -> Any:
    """OpenCV's ChArUco board: squares of `side` [m], tags of three quarters of it."""
    return cv2().aruco.CharucoBoard((columns, rows), side, 0.75 * side, dictionary())


def lens(views: Sequence[np.ndarray], board: Any) -> Lens:
    """Intrinsics from pictures of the board, held at different angles and places.

    Args:
        views: pictures ``(H, W)``, all of the same size.
        board: what `squares` gives, printed to that size.

    Raises:
        BnsError: the board is found in too few of them.
    """
    detector = cv2().aruco.CharucoDetector(board)
    objects, pixels = [], []
    for view in views:
        corners, numbers, _, _ = detector.detectBoard(view)
        if numbers is None or len(numbers) < 8:
            continue
        known, seen = board.matchImagePoints(corners, numbers)
        objects.append(known)
        pixels.append(seen)
    if len(objects) < LEAST_VIEWS:
        raise BnsError(
            f"The board of squares is seen in {len(objects)} of {len(views)} pictures; "
            f"{LEAST_VIEWS} are needed: hold it nearer, flat, in all corners."
        )
    size = (views[0].shape[1], views[0].shape[0])
    error, matrix, distortion, _, _ = cv2().calibrateCamera(
        objects, pixels, size, None, None
    )
    return Lens(size, matrix, distortion.ravel()[:5], float(error))


def place(
    image: np.ndarray, known: Camera | Lens, floor: Floor, *, latency: float = 0.0
) -> Camera:
    """The camera's place from the tags on the floor.

    Args:
        image: picture with the tags in view ``(H, W)``.
        known: the lens, or a camera with that lens.
        floor: where the tags lie.
        latency: see `Camera`.

    Raises:
        BnsError: too few tags are seen, or they do not lie where they are said to.
    """
    found = Finder().anywhere(image)
    places = floor.corners()
    seen = sorted(set(found) & set(places))
    if len(seen) < LEAST_TAGS:
        raise BnsError(
            f"{len(seen)} of {len(places)} floor tags are in view ({LEAST_TAGS} are "
            "needed): uncover them, light them evenly, aim the camera at the board."
        )
    objects = np.concatenate([places[number] for number in seen])
    pixels = np.concatenate([found[number] for number in seen])
    _, vector, shift = cv2().solvePnP(
        objects, pixels, np.asarray(known.matrix), np.asarray(known.distortion)
    )
    rotation = cv2().Rodrigues(vector)[0]
    position = -(rotation.T @ shift).ravel()
    camera = Camera(
        known.size,
        np.asarray(known.matrix, float),
        np.asarray(known.distortion, float),
        rotation,
        position,
        latency,
    )
    worst = np.linalg.norm(camera.project(objects) - pixels, axis=1).max()
    if worst > 2.0:
        raise BnsError(
            f"A floor tag is {worst:.1f} px from where it should be: measure their "
            "places again, or calibrate the lens."
        )
    return camera


def height(
    sightings: Sequence[Sighting],
    camera: Camera,
    marker: Marker,
    *,
    image: np.ndarray,
    floor: Floor,
) -> Height:
    """The height of the robot's tag, from the size it is seen with.

    A tag that is nearer to the camera is seen larger. Blur moves its edges by a
    share of a pixel; the floor tags, whose height is known, tell by how much.

    Args:
        sightings: at rest or moving, the more the better.
        camera: calibrated.
        marker: as the settings describe it.
        image: a picture with floor tags, ``(H, W)`` or ``(H, W, 3)``.
        floor: their places.
    """
    shrunk = _shrunk(image, camera, floor)
    depth = camera.position[2] - marker.height
    sides = np.array([sighting.side for sighting in sightings])
    sides = sides + shrunk * depth / camera.matrix[0, 0]
    heights = camera.position[2] - depth * marker.side / sides
    error = float(np.std(heights) / np.sqrt(len(heights)))
    return Height(float(np.median(heights)), error, marker.height)


def askew(sighting: Sighting, camera: Camera) -> float:
    """How far a tag is turned against the rows and columns of the picture [deg].

    An edge along them is found a share of a pixel off, the same all along.
    """
    x, y, yaw = sighting.pose
    ahead = np.array([[x, y, 0.0], [x + np.cos(yaw) / 10, y + np.sin(yaw) / 10, 0.0]])
    if not np.isfinite(ahead).all():
        return 45.0
    start, end = camera.project(ahead)
    angle = np.degrees(np.arctan2(*(end - start)[::-1])) % 90.0
    return float(min(angle, 90.0 - angle))


def _shrunk(image: np.ndarray, camera: Camera, floor: Floor) -> float:
    """By how many pixels a side is seen too short."""
    found = Finder().anywhere(image)
    short = []
    for number in set(found) & set(floor.places):
        places = camera.on_plane(found[number], 0.0)
        sides = np.linalg.norm(places - np.roll(places, 1, axis=0), axis=1)
        short.append(floor.side - sides.mean())
    if not short:
        return 0.0
    return float(np.mean(short)) * camera.matrix[0, 0] / float(camera.position[2])
