"""A calibrated camera: from the world to pixels and back to a plane."""

import json
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path

import numpy as np

from bns.errors import FormatError
from bns.hardware.tracking.opencv import cv2
from bns.models.arena import CAMERA_HEIGHT, SIZE

MARGIN = 1.06  # of the board's height that the overhead camera sees
DOWN = np.diag([1.0, -1.0, -1.0])  # a camera that looks straight down, x to the right


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
    def overhead(cls, size: tuple[int, int], *, height: float = CAMERA_HEIGHT):
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
        Path(path).write_text(json.dumps(held, indent=1) + "\n", encoding="utf-8")

    @classmethod
    def read(cls, path: Path | str) -> "Camera":
        """The camera saved in a file.

        Raises:
            FormatError: there is none, or it is something else.
        """
        try:
            held = json.loads(Path(path).read_text(encoding="utf-8"))
            if held["format"] != "bns-camera":
                raise KeyError("format")
            made = cls(
                (int(held["size"][0]), int(held["size"][1])),
                np.array(held["matrix"], float).reshape(3, 3),
                np.array(held["distortion"], float).reshape(5),
                np.array(held["rotation"], float).reshape(3, 3),
                np.array(held["position"], float).reshape(3),
                float(held["latency"]),
            )
        except (OSError, ValueError, KeyError, TypeError, IndexError) as error:
            raise FormatError(
                f"{path} is no camera calibration ({error}): make one with "
                "`bns hardware calibrate`."
            ) from error
        return made


def plane_points(pose: Sequence[float], local: np.ndarray, height: float) -> np.ndarray:
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
