"""The camera over an emulated robot: its process tells poses, the host paints them.

The robot's process sends a pose per picture over a Unix socket beside its port
(`PORT.camera`); the picture is painted where it is wanted, so that painting does not
hold up the robot.
"""

import contextlib
import os
import select
import socket
import struct
import time
from collections import deque
from pathlib import Path

import numpy as np

from bns.errors import BnsError
from bns.hardware.emulators.frames import Painter
from bns.hardware.emulators.live_body import LiveBody
from bns.hardware.tracking.tracker import Frame

MESSAGE = struct.Struct("<dq8d")  # time, number, x, y, yaw, height, quaternion
SUFFIX = ".camera"


class PoseServer:
    """Tells the poses of an emulated robot, a message per picture.

    Args:
        body: the robot's.
        port: path of its port; the socket lies beside it.
        rate: pictures a second.
        latency: from a picture being taken to its being told [s].
    """

    def __init__(
        self,
        body: LiveBody,
        port: Path | str,
        *,
        rate: float = 30.0,
        latency: float = 0.03,
    ):
        self.body, self.rate, self.latency = body, rate, latency
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
            self._waiting.append((now + self.latency, message))
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
                f"There is no emulated camera beside {port}: start the robot with "
                "`bns hardware emulate khepera3`, or give the number of a real one."
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
