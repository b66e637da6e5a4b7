"""Pictures of an emulated robot: drawn by projecting its tag, no OpenGL needed."""

from collections.abc import Sequence

import numpy as np

from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.camera import Camera, plane_points
from bns.hardware.tracking.marker import CELLS, Floor, Marker
from bns.hardware.tracking.opencv import cv2

BOARD, BODY = 205, 70  # grey values (assumed)
PLATE = 8 / 6  # side of the white plate in sides of the tag: a cell of white around
FINE = 4  # subpixels a side
CELL = 20  # px of a cell of the texture
RADIUS = 0.064  # m; of the robot's body
SPARE = 64  # px by which the stored noise is larger than a picture


class Painter:
    """Draws what a camera over the arena sees.

    Args:
        camera: where from.
        marker: on the robot.
        floor: tags on the board.
        noise: standard deviation of grey values.
        blur: standard deviation of the lens's blur [px].
        rng: for the noise.
    """

    def __init__(
        self,
        camera: Camera,
        marker: Marker,
        *,
        floor: Floor | None = None,
        noise: float = 2.0,
        blur: float = 0.6,
        rng: np.random.Generator | None = None,
    ):
        self.camera, self.marker, self.blur = camera, marker, blur
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

    def paint(self, pose: Sequence[float] | None) -> np.ndarray:
        """The picture of a robot at a pose (None: taken away), ``(H, W)`` uint8."""
        image = self._empty.copy()
        if pose is not None:
            marker = self.marker
            around = np.linspace(0, 2 * np.pi, 32, endpoint=False)
            ring = RADIUS * np.column_stack([np.cos(around), np.sin(around)])
            rim = self.camera.project(plane_points(pose, ring, marker.height))
            whole = np.rint(rim * 16).astype(np.int32)
            cv2().fillPoly(image, [whole], BODY, lineType=cv2().LINE_AA, shift=4)
            middle = marker.corners().mean(0)
            plate = middle + PLATE * (marker.corners() - middle)
            self._lay(image, plane_points(pose, plate, marker.height), self._tag)
        return self._grainy(image)

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
        module, pixels = cv2(), self.camera.project(corners)
        low = np.maximum(np.floor(pixels.min(0)).astype(int) - 4, 0)
        high = np.minimum(np.ceil(pixels.max(0)).astype(int) + 5, self.camera.size)
        width, tall = (int(v) for v in high - low)
        if min(width, tall) <= 0:
            return
        end = len(texture) - 0.5
        own = np.float32([[-0.5, -0.5], [end, -0.5], [end, end], [-0.5, end]])
        fine = ((pixels - low + 0.5) * FINE - 0.5).astype(np.float32)
        turn = module.getPerspectiveTransform(own, fine)

        def seen(what: np.ndarray) -> np.ndarray:
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


def _grains(
    rng: np.random.Generator, noise: float, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Noise to add and to take away, larger than a picture, uint8."""
    grains = np.rint(rng.normal(0, noise, (shape[0] + SPARE, shape[1] + SPARE)))
    return grains.clip(0, 255).astype(np.uint8), (-grains).clip(0, 255).astype(np.uint8)
