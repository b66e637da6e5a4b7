"""Pictures of an emulated robot: drawn by projecting its tag, no OpenGL needed."""

from collections.abc import Sequence

import numpy as np

from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.camera import Camera
from bns.hardware.tracking.marker import CELLS, Floor, Marker
from bns.hardware.tracking.opencv import cv2

BOARD, BODY = 205, 70  # grey values (assumed)
PLATE = 8 / 6  # side of the white plate in sides of the tag: a cell of white around
FINE = 4  # subpixels a side
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
        self._tag = tags.picture(marker.number, border=(PLATE - 1) / 2 * CELLS)
        floor = floor or Floor()
        half = floor.side / 2 * (CELLS + 2) / CELLS  # with a border of a cell
        for number, (x, y, yaw) in floor.places.items():
            tag = tags.picture(number)
            self._draw(self._empty, (x, y), yaw, half, 0.0, tag, 0)
        self._grains = _grains(rng, noise, (height, width)) if noise else None
        self._rng = rng

    def paint(self, pose: Sequence[float] | None) -> np.ndarray:
        """The picture of a robot at a pose (None: taken away), ``(H, W)`` uint8."""
        image = self._empty.copy()
        if pose is not None:
            x, y, yaw = pose
            self._draw(image, (x, y), yaw, 0.064, self.marker.height, None, BODY)
            cos, sin = np.cos(yaw), np.sin(yaw)
            own = (self.marker.x, self.marker.y)
            place = (x + cos * own[0] - sin * own[1], y + sin * own[0] + cos * own[1])
            half = self.marker.side / 2 * PLATE
            turned = yaw + self.marker.yaw
            self._draw(image, place, turned, half, self.marker.height, self._tag, 0)
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

    def _draw(
        self,
        image: np.ndarray,
        centre: Sequence[float],
        yaw: float,
        half: float,
        height: float,
        texture: np.ndarray | None,
        grey: int,
    ) -> None:
        """A square with a texture, or a disc of a grey value, on a plane."""
        left, top, right, bottom = self._window(centre, half * 1.5, height)
        if left >= right or top >= bottom:
            return
        u = left + (np.arange((right - left) * FINE) + 0.5) / FINE - 0.5
        v = top + (np.arange((bottom - top) * FINE) + 0.5) / FINE - 0.5
        grid = np.stack(np.meshgrid(u, v), axis=-1)
        places = self.camera.on_plane(grid.reshape(-1, 2), height) - centre
        cos, sin = np.cos(yaw), np.sin(yaw)
        own = places @ np.array([[cos, -sin], [sin, cos]])  # x forward, y left
        part = image[top:bottom, left:right].astype(np.float32)
        if texture is None:
            drawn = np.full(len(own), float(grey), np.float32)
            inside = np.hypot(*own.T) <= half
        else:
            size = texture.shape[0]
            column = ((-own[:, 1] / half + 1) / 2 * size - 0.5).astype(np.float32)
            row = ((-own[:, 0] / half + 1) / 2 * size - 0.5).astype(np.float32)
            shape = grid.shape[:2]
            module = cv2()
            drawn = module.remap(
                texture, column.reshape(shape), row.reshape(shape),
                module.INTER_LINEAR, borderMode=module.BORDER_REPLICATE,
            ).ravel().astype(np.float32)  # fmt: skip
            inside = np.abs(own).max(1) <= half
        self._blend(part, drawn, inside, grid.shape[:2])
        image[top:bottom, left:right] = np.rint(part).astype(np.uint8)

    def _blend(self, part, drawn, inside, shape) -> None:
        """Average the subpixels into the picture, blurred as by a lens."""

        def mean(values: np.ndarray) -> np.ndarray:
            fine = values.reshape(shape)
            blocks = fine.reshape(shape[0] // FINE, FINE, shape[1] // FINE, FINE)
            return blocks.mean((1, 3))

        share = mean(inside.astype(np.float32))
        ink = mean(np.where(inside, drawn, 0).astype(np.float32))
        if self.blur:
            module = cv2()
            share = module.GaussianBlur(share, (0, 0), self.blur)
            ink = module.GaussianBlur(ink, (0, 0), self.blur)
        part *= 1 - share
        part += ink

    def _window(
        self, centre: Sequence[float], half: float, height: float
    ) -> tuple[int, int, int, int]:
        around = np.array([[-1, -1], [1, -1], [1, 1], [-1, 1]]) * half + centre
        pixels = self.camera.project(np.column_stack([around, np.full(4, height)]))
        low = np.floor(pixels.min(0)).astype(int) - 3
        high = np.ceil(pixels.max(0)).astype(int) + 3
        width, tall = self.camera.size
        left, right = np.clip([low[0], high[0]], 0, width)
        top, bottom = np.clip([low[1], high[1]], 0, tall)
        return int(left), int(top), int(right), int(bottom)


def _grains(
    rng: np.random.Generator, noise: float, shape: tuple[int, int]
) -> tuple[np.ndarray, np.ndarray]:
    """Noise to add and to take away, larger than a picture, uint8."""
    grains = np.rint(rng.normal(0, noise, (shape[0] + SPARE, shape[1] + SPARE)))
    return grains.clip(0, 255).astype(np.uint8), (-grains).clip(0, 255).astype(np.uint8)
