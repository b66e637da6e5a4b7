"""The camera over an emulated robot: its process tells poses, the host paints them.

The robot's process sends a pose per picture over a Unix socket beside its port
(`PORT.camera`); the picture is painted where it is wanted, so that painting does not
hold up the robot. It is drawn by projecting the robot's tag; no OpenGL is needed.
"""

import contextlib
import os
import select
import socket
import struct
import time
from collections import deque
from collections.abc import Sequence
from pathlib import Path

import numpy as np

from bns.errors import BnsError
from bns.hardware.emulators.device import LiveBody
from bns.hardware.tracking import marker as tags
from bns.hardware.tracking.camera import Camera, cv2, plane_points
from bns.hardware.tracking.marker import CELLS, MARKERS, Floor, Marker
from bns.hardware.tracking.tracker import Frame

BOARD, BODY = 205, 70  # grey values (assumed)
PLATE = 8 / 6  # side of the white plate in sides of the tag: a cell of white around
FINE = 4  # subpixels a side
CELL = 20  # px of a cell of the texture
RADIUS = 0.064  # m; of the Khepera III's body
TRUNK, HIPS = 0.12, 0.0918  # m; the hexapod's body and its height (its `home` pose)
BLUR = 0.6  # px; standard deviation of the lens's blur
SPARE = 64  # px by which the stored noise is larger than a picture


class Painter:
    """Draws what a camera over the arena sees.

    Args:
        camera: where from.
        marker: on the robot.
        noise: standard deviation of grey values.
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
        noise: float = 2.0,
        shake: float = 0.0,
        rng: np.random.Generator | None = None,
        radius: float = RADIUS,
        base: float | None = None,
    ):
        self.camera, self.marker = camera, marker
        self.radius, self.base, self.shake = radius, base, shake
        self._moved = np.zeros(2)
        rng = rng or np.random.default_rng(0)
        width, height = camera.size
        self._empty = np.full((height, width), BOARD, np.uint8)
        self._tag = tags.picture(
            marker.number, cell=CELL, border=(PLATE - 1) / 2 * CELLS
        )
        floor = Floor()
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
            return module.GaussianBlur(small, (0, 0), BLUR)

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


MESSAGE = struct.Struct("<dq8d")  # time, number, x, y, yaw, height, quaternion
SUFFIX = ".camera"
LATENCY = 0.03  # s from a picture being taken to its being told


class PoseServer:
    """Tells the poses of an emulated robot, a message per picture.

    Args:
        body: the robot's.
        port: path of its port; the socket lies beside it.
        rate: pictures a second.
    """

    def __init__(self, body: LiveBody, port: Path | str, *, rate: float = 30.0):
        self.body, self.rate = body, rate
        self.path = Path(str(port) + SUFFIX)
        with contextlib.suppress(OSError):
            self.path.unlink()
        self._listener = socket.socket(socket.AF_UNIX)
        try:
            self._listener.bind(str(self.path))
        except OSError as error:
            raise BnsError(f"{self.path} cannot be made: {error}.") from error
        self._listener.listen()
        self._listener.setblocking(False)
        self._clients: list[socket.socket] = []
        self._waiting: deque[tuple[float, bytes]] = deque()
        self._next, self._count = 0.0, 0
        self._last = (0.0, 0, [0.0] * 8)  # time, number, pose and attitude
        self.mode = ""  # see `mishaps`

    def serve(self, now: float) -> None:
        """Tell what is due; called in the robot's loop."""
        with contextlib.suppress(BlockingIOError):
            client, _ = self._listener.accept()
            client.setblocking(False)
            self._clients.append(client)
        if now >= self._next:
            self._next = max(self._next + 1 / self.rate, now)
            self._count += 1
            self._last = self._picture(now)
            at, number, pose = self._last
            message = MESSAGE.pack(at, number, *pose)
            self._waiting.append((now + LATENCY, message))
        while self._waiting and self._waiting[0][0] <= now:
            message = self._waiting.popleft()[1]
            if self.mode != "covered":
                self._tell(message)

    def _picture(self, now: float) -> tuple[float, int, list[float]]:
        """Time, number, pose and attitude of the next picture."""
        at, number, pose = self._last
        if self.mode == "frozen":
            return now, number, pose
        if self.mode == "stuck":
            return now, self._count, pose
        seen = [*self.body.pose(now), *self.body.attitude(now)]
        return at if self.mode == "stale" else now, self._count, seen

    def _tell(self, message: bytes) -> None:
        for client in list(self._clients):
            try:
                client.send(message)
            except BlockingIOError:
                continue
            except OSError:
                self._clients.remove(client)
                client.close()

    def close(self) -> None:
        """Take the socket away."""
        for item in (*self._clients, self._listener):
            item.close()
        with contextlib.suppress(OSError):
            os.unlink(self.path)


class EmulatedCamera:
    """The host's side: paints a picture for each pose that is told.

    Args:
        port: of the emulated robot.
        painter: says what the camera is and what is on the robot.

    Raises:
        BnsError: no emulated robot there.
    """

    def __init__(self, port: Path | str, painter: Painter):
        self.painter, self.size = painter, painter.camera.size
        self._socket = socket.socket(socket.AF_UNIX)
        try:
            self._socket.connect(str(port) + SUFFIX)
        except OSError as error:
            self._socket.close()
            raise BnsError(
                f"No emulated camera is there for --port {port or '(none given)'}: "
                "start a robot with `bns hardware emulate khepera3`, or give the "
                "number of a real one as --camera."
            ) from error
        self._buffer = b""
        self._number, self._image = -1, np.zeros((0, 0), np.uint8)

    def read(self, timeout: float) -> Frame | None:
        """The next picture, see `Source.read`; older ones not yet seen are skipped.

        Args:
            timeout: how long to wait for one [s].

        Raises:
            BnsError: the emulated robot has ended.
        """
        until = time.monotonic() + timeout
        while True:
            wait = (
                0.0 if len(self._buffer) >= MESSAGE.size else until - time.monotonic()
            )
            if select.select([self._socket], [], [], max(wait, 0.0))[0]:
                data = self._socket.recv(65536)
                if not data:
                    raise BnsError("The emulated camera is gone: the robot has ended.")
                self._buffer += data
                continue
            if len(self._buffer) < MESSAGE.size:
                return None
            whole = len(self._buffer) // MESSAGE.size * MESSAGE.size
            newest = self._buffer[whole - MESSAGE.size : whole]
            self._buffer = self._buffer[whole:]
            at, number, *pose = MESSAGE.unpack(newest)
            if number != self._number:  # else the camera hangs
                self._image = self.painter.paint(pose[:3], pose[3:])
            self._number = number
            return Frame(at, self._image, number)

    def close(self) -> None:
        """Hang up."""
        self._socket.close()


class BodyPainter:
    """Paints a body in the same process, in virtual time.

    Args:
        body: the robot's.
        painter: of the camera above.
    """

    def __init__(self, body: LiveBody, painter: Painter):
        self.body, self.painter = body, painter

    def paint_at(self, at: float) -> np.ndarray:
        """The picture taken at a time [s]."""
        self.body.advance(at)
        return self.painter.paint([*self.body.pose(at)], [*self.body.attitude(at)])
