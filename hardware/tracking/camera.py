"""A calibrated camera: from the world to pixels and back to a plane."""

from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import Annotated, Any, Literal, Self

import msgspec
import numpy as np

from bns.errors import FormatError, MissingDependencyError, install
from bns.models.arena import CAMERA_HEIGHT, SIZE
from bns.storage import files, reading, seal


def cv2() -> Any:
    """The module `cv2`.

    Raises:
        MissingDependencyError: it is not installed, or it has no ArUco.
    """
    try:
        import cv2 as module
    except ImportError as error:
        raise MissingDependencyError(
            "tracking", "opencv-python-headless", install("hardware")
        ) from error
    if not hasattr(module, "aruco"):
        raise MissingDependencyError("tracking", "ArUco in OpenCV", install("hardware"))
    logging = module if hasattr(module, "setLogLevel") else module.utils.logging
    logging.setLogLevel(0)  # silent; OpenCV 4 has it at the top, 5 below
    module.setNumThreads(1)  # its threads would not share this one's precedence
    return module


MARGIN = 1.06  # of the board's height that the overhead camera sees
DOWN = np.diag([1.0, -1.0, -1.0])  # a camera that looks straight down, x to the right


Pixels = Annotated[int, msgspec.Meta(ge=16, le=32768)]
Focal = Annotated[float, msgspec.Meta(ge=-1e6, le=1e6)]
Metres = Annotated[float, msgspec.Meta(ge=-1000, le=1000)]
Share = Annotated[float, msgspec.Meta(ge=-1.000001, le=1.000001)]
Lens = Annotated[float, msgspec.Meta(ge=-1e4, le=1e4)]


class Calibration(msgspec.Struct, forbid_unknown_fields=True):
    """The file of a camera, see `Camera`."""

    format: Literal["bns-camera"]
    size: tuple[Pixels, Pixels]
    matrix: tuple[tuple[Focal, Focal, Focal], ...]
    distortion: tuple[Lens, Lens, Lens, Lens, Lens]
    rotation: tuple[tuple[Share, Share, Share], ...]
    position: tuple[Metres, Metres, Metres]
    latency: Annotated[float, msgspec.Meta(ge=0, le=10)]

    def __post_init__(self) -> None:
        if len(self.matrix) != 3 or len(self.rotation) != 3:
            raise ValueError("matrix and rotation need three rows")


@dataclass(frozen=True, eq=False)
class Camera:
    """Intrinsics, distortion and place of a camera.

    Attributes:
        size: width and height of its pictures [px].
        matrix: focal lengths and principal point, ``(3, 3)`` [px]; the centre of the
            first pixel is (0, 0).
        distortion: k1, k2, p1, p2, k3 of OpenCV's model, ``(5,)``.
        rotation: from the world frame to the camera's (x right, y down, z ahead),
            ``(3, 3)``.
        position: of the camera in the world frame [m], ``(3,)``.
        latency: from a picture being taken to its time stamp [s].
    """

    size: tuple[int, int]
    matrix: np.ndarray
    distortion: np.ndarray
    rotation: np.ndarray
    position: np.ndarray
    latency: float = 0.0

    @classmethod
    def overhead(cls, size: tuple[int, int], *, height: float = CAMERA_HEIGHT) -> Self:
        """The ideal camera of the arena model, looking straight down.

        Args:
            size: of its pictures [px].
            height: above the board [m].
        """
        focal = size[1] / 2 / (SIZE[1] / 2 * MARGIN / height)
        centre = (size[0] - 1) / 2, (size[1] - 1) / 2
        matrix = np.array([[focal, 0, centre[0]], [0, focal, centre[1]], [0, 0, 1]])
        return cls(size, matrix, np.zeros(5), DOWN, np.array([0.0, 0.0, height]))

    def project(self, points: np.ndarray) -> np.ndarray:
        """Pixels ``(N, 2)`` of points in the world ``(N, 3)`` [m]."""
        vector = cv2().Rodrigues(self.rotation)[0]
        shift = -self.rotation @ self.position
        given = np.asarray(points, dtype=np.float64).reshape(-1, 1, 3)
        seen, _ = cv2().projectPoints(
            given, vector, shift, self.matrix, self.distortion
        )
        return seen.reshape(-1, 2)

    def on_plane(self, pixels: np.ndarray, height: float) -> np.ndarray:
        """Where the rays through pixels meet the plane at a height above the board.

        Args:
            pixels: ``(N, 2)``.
            height: [m].

        Returns:
            x and y in the world frame, ``(N, 2)`` [m].
        """
        given = np.asarray(pixels, dtype=np.float64).reshape(-1, 1, 2)
        if self.distortion.any():
            plain = cv2().undistortPoints(given, self.matrix, self.distortion)
            plain = plain.reshape(-1, 2)
        else:
            plain = (given[:, 0] - self.matrix[:2, 2]) / np.diag(self.matrix)[:2]
        rays = np.column_stack([plain, np.ones(len(plain))]) @ self.rotation
        reach = (height - self.position[2]) / rays[:, 2]
        return self.position[:2] + reach[:, None] * rays[:, :2]

    def write(self, path: Path | str) -> None:
        """Save as JSON."""
        held = {
            "format": "bns-camera",
            "size": list(self.size),
            "matrix": np.asarray(self.matrix).tolist(),
            "distortion": np.asarray(self.distortion).tolist(),
            "rotation": np.asarray(self.rotation).tolist(),
            "position": np.asarray(self.position).tolist(),
            "latency": self.latency,
        }
        files.write_json(path, held)

    @classmethod
    def read(cls, path: Path | str) -> "Camera":
        """The camera saved in a file.

        Raises:
            FormatError: there is none, or it is something else.
        """
        todo = "Make one with `bns hardware calibrate`."
        content = seal.opened(reading.read_json(path), path)
        held = reading.typed(content, Calibration, path, todo=todo)
        matrix, rotation = np.array(held.matrix), np.array(held.rotation)
        bottom = np.array_equal(matrix[2], (0, 0, 1))
        if not bottom or min(matrix[0, 0], matrix[1, 1]) < 1 or matrix[1, 0]:
            raise FormatError(
                f"{path}: matrix needs focal lengths of 1 px at least and the last row "
                f"0, 0, 1. {todo}"
            )
        turned = np.allclose(rotation @ rotation.T, np.eye(3), atol=1e-6)
        if not turned or np.linalg.det(rotation) < 0:
            raise FormatError(f"{path}: rotation is none. {todo}")
        return cls(
            held.size,
            matrix,
            np.array(held.distortion),
            rotation,
            np.array(held.position),
            held.latency,
        )


def plane_points(
    pose: Sequence[float] | np.ndarray, local: np.ndarray, height: float
) -> np.ndarray:
    """Points of a robot's frame in the world, ``(N, 3)``.

    Args:
        pose: of the robot (x, y, yaw) [m, m, rad].
        local: ``(N, 2)`` [m], x forward, y left.
        height: [m].
    """
    x, y, yaw = pose
    cos, sin = np.cos(yaw), np.sin(yaw)
    turned = np.asarray(local) @ np.array([[cos, sin], [-sin, cos]])
    return np.column_stack([turned + np.array([x, y]), np.full(len(turned), height)])
