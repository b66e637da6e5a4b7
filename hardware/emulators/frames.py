"""Pictures of an emulated robot: drawn by projecting its tag, no OpenGL needed."""

from collections.abc import Sequence

import numpy as np

from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.camera import Camera, plane_points
from bns.hardware.tracking.marker import CELLS, MARKERS, Floor, Marker
from bns.hardware.tracking.opencv import cv2

BOARD, BODY = 205, 70  # grey values (assumed)
PLATE = 8 / 6  # side of the white plate in sides of the tag: a cell of white around
FINE = 4  # subpixels a side
CELL = 20  # px of a cell of the texture
RADIUS = 0.064  # m; of the Khepera III's body
TRUNK, HIPS = 0.12, 0.0918  # m; the hexapod's body and its height (its `home` pose)
SPARE = 64  # px by which the stored noise is larger than a picture


class Painter:
    """Draws what a camera over the arena sees.

    Args:
        camera: where from.
        marker: on the robot.
        floor: tags on the board.
        noise: standard deviation of grey values.
        blur: standard deviation of the lens's blur [px].
        shake: standard deviation of where the camera's tremble puts the robot [px].
        rng: for the noise.
        radius: of the robot's body [m].
        base: height of the robot's frame above the board, as it stands [m]; the tag
            tilts and sinks with it. None = a robot that does not.
    """

    def __init__(
        self,
        camera: Camera,
        marker: Marker,
        *,
        floor: Floor | None = None,
        noise: float = 2.0,
        blur: float = 0.6,
        shake: float = 0.0,
        rng: np.random.Generator | None = None,
        radius: float = RADIUS,
        base: float | None = None,
    ):
        self.camera, self.marker, self.blur = camera, marker, blur
        self.radius, self.base, self.shake = radius, base, shake
        self._moved = np.zeros(2)
        rng = rng or np.random.default_rng(0)
        width, height = camera.size
        self._empty = np.full((height, width), BOARD, np.uint8)
        self._tag = tags.picture(
            marker.number, cell=CELL, border=(PLATE - 1) / 2 * CELLS
        )
        floor = floor or Floor()
        half = floor.side / 2 * (CELLS + 2) / CELLS  # with a border of a cell
        for number, (x, y, yaw) in floor.places.items():
            square = Marker(number, 2 * half, 0.0, x, y, yaw).corners()
            tag = tags.picture(number, cell=CELL)
            self._lay(self._empty, np.column_stack([square, np.zeros(4)]), tag)
        self._grains = _grains(rng, noise, (height, width)) if noise else None
        self._rng = rng

    def paint(
        self, pose: Sequence[float] | None, attitude: Sequence[float] = ()
    ) -> np.ndarray:
        """The picture of a robot, ``(H, W)`` uint8.

        Args:
            pose: (x, y, yaw) [m, m, rad]; None: taken away.
            attitude: height of its frame [m] and its quaternion.
        """
        image = self._empty.copy()
        if self.shake:
            self._moved = self._rng.normal(0, self.shake, 2)
        if pose is not None:
            marker = self.marker
            around = np.linspace(0, 2 * np.pi, 32, endpoint=False)
            ring = self.radius * np.column_stack([np.cos(around), np.sin(around)])
            rim = self.camera.project(self._points(pose, attitude, ring))
            whole = np.rint(rim * 16).astype(np.int32)
            cv2().fillPoly(image, [whole], BODY, lineType=cv2().LINE_AA, shift=4)
            middle = marker.corners().mean(0)
            plate = middle + PLATE * (marker.corners() - middle)
            self._lay(image, self._points(pose, attitude, plate), self._tag)
        return self._grainy(image)

    def _points(
        self, pose: Sequence[float], attitude: Sequence[float], local: np.ndarray
    ) -> np.ndarray:
        """Points of the tag's plane in the world, ``(N, 3)``."""
        if self.base is None or not len(attitude):
            return plane_points(pose, local, self.marker.height)
        height, w, x, y, z = attitude
        turn = np.array(
            [
                [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)],
                [2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)],
                [2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)],
            ]
        )
        above = np.full(len(local), self.marker.height - self.base)
        points = np.column_stack([local, above]) @ turn.T
        return points + np.array([pose[0], pose[1], height])

    def _grainy(self, image: np.ndarray) -> np.ndarray:
        if self._grains is None:
            return image
        row, column = self._rng.integers(0, SPARE, 2)
        height, width = image.shape
        more, less = (
            bank[row : row + height, column : column + width] for bank in self._grains
        )
        return cv2().subtract(cv2().add(image, more), less)

    def _lay(self, image: np.ndarray, corners: np.ndarray, texture: np.ndarray) -> None:
        """Draw a square with a texture.

        Args:
            image: changed.
            corners: of the square in the world, ``(4, 3)`` [m], in OpenCV's order.
            texture: what is on it.
        """
        module, pixels = cv2(), self.camera.project(corners) + self._moved
        low = np.maximum(np.floor(pixels.min(0)).astype(int) - 4, 0)
        high = np.minimum(np.ceil(pixels.max(0)).astype(int) + 5, self.camera.size)
        width, tall = (int(v) for v in high - low)
        if min(width, tall) <= 0:
            return
        end = len(texture) - 0.5
        square = [[-0.5, -0.5], [end, -0.5], [end, end], [-0.5, end]]
        own = np.array(square, np.float32)
        fine = ((pixels - low + 0.5) * FINE - 0.5).astype(np.float32)
        turn = module.getPerspectiveTransform(own, fine)

        def seen(what: np.ndarray) -> np.ndarray:
            """A texture as the camera's pixels see it."""
            size = (width * FINE, tall * FINE)
            warped = module.warpPerspective(what.astype(np.float32), turn, size)
            small = module.resize(
                warped, (width, tall), interpolation=module.INTER_AREA
            )
            if not self.blur:
                return small
            return module.GaussianBlur(small, (0, 0), self.blur)

        part = image[low[1] : high[1], low[0] : high[0]]
        share = seen(np.ones_like(texture))
        mixed = part * (1 - share) + seen(texture)
        part[:] = np.rint(mixed).clip(0, 255).astype(np.uint8)


def painter(robot: str, camera: Camera) -> Painter:
    """Who draws a robot: its tag, and a disc as large as it."""
    if robot == "khepera3":
        return Painter(camera, MARKERS[robot])
    return Painter(camera, MARKERS[robot], radius=TRUNK, base=HIPS)


def _grains(
    rng: np.random.Generator, noise: float, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Noise to add and to take away, larger than a picture, uint8."""
    grains = np.rint(rng.normal(0, noise, (shape[0] + SPARE, shape[1] + SPARE)))
    return grains.clip(0, 255).astype(np.uint8), (-grains).clip(0, 255).astype(np.uint8)
