"""The tracker at work: pictures of a camera or a video file turned into sightings.

It works beside whatever else goes on.
"""

import threading
import time
from collections import deque
from pathlib import Path
from typing import Any, Protocol

import numpy as np

from bns.errors import BnsError
from bns.hardware.clock import VirtualClock, urgent
from bns.hardware.tracking.camera import cv2
from bns.hardware.tracking.tracker import Frame, Sighting, Tracker


class Source(Protocol):
    """Something that gives pictures.

    Attributes:
        size: width and height [px].
    """

    size: tuple[int, int]

    def read(self, timeout: float) -> Frame | None:
        """The next picture, None where none came within the time [s].

        Raises:
            BnsError: there will be no more.
        """
        ...

    def close(self) -> None:
        """Give the camera back."""
        ...


class DeviceCamera:
    """A camera of this machine.

    Args:
        number: of the device, 0 being the first.
        size: wanted [px].

    Raises:
        BnsError: no such camera, it is in use, or it cannot give that size.
    """

    def __init__(self, number: int, size: tuple[int, int] = (1920, 1080)):
        module = cv2()
        self._capture = module.VideoCapture(number)
        self._capture.set(module.CAP_PROP_FRAME_WIDTH, size[0])
        self._capture.set(module.CAP_PROP_FRAME_HEIGHT, size[1])
        good, picture = self._capture.read()
        if not good:
            self._capture.release()
            raise BnsError(
                f"Camera {number} gives no picture: check that it is plugged in and "
                "not in use, or give another --camera."
            )
        self.size, self._count = (picture.shape[1], picture.shape[0]), 0
        if self.size != size:
            self._capture.release()
            raise BnsError(
                f"Camera {number} gives {self.size[0]} x {self.size[1]} pictures, the "
                f"calibration is of {size[0]} x {size[1]}: calibrate it again."
            )

    def read(self, timeout: float) -> Frame | None:
        """The next picture, see `Source.read`; waits as long as the driver does.

        Raises:
            BnsError: the camera gives no more pictures.
        """
        del timeout
        good, picture = self._capture.read()
        if not good:
            raise BnsError("The camera gives no more pictures: check its cable.")
        self._count += 1
        return Frame(time.monotonic(), _grey(picture), self._count)

    def close(self) -> None:
        """Give the camera back."""
        self._capture.release()


class VideoFile:
    """A recorded video; its pictures have the times of the recording.

    Args:
        path: of the file.

    Raises:
        BnsError: it cannot be read.
    """

    def __init__(self, path: Path | str):
        module = cv2()
        self._capture = module.VideoCapture(str(path))
        if not self._capture.isOpened():
            raise BnsError(f"{path} is no video that OpenCV can read.")
        self._rate = self._capture.get(module.CAP_PROP_FPS) or 25.0
        self.size = (
            int(self._capture.get(module.CAP_PROP_FRAME_WIDTH)),
            int(self._capture.get(module.CAP_PROP_FRAME_HEIGHT)),
        )
        self._count = 0

    def read(self, timeout: float) -> Frame | None:
        """The next picture, see `Source.read`.

        Raises:
            BnsError: the video is at its end.
        """
        del timeout
        good, picture = self._capture.read()
        if not good:
            raise BnsError("The video is at its end.")
        at = self._count / self._rate
        self._count += 1
        return Frame(at, _grey(picture), self._count - 1)

    def close(self) -> None:
        """Close the file."""
        self._capture.release()


def _grey(picture: Any) -> Any:
    module = cv2()
    return module.cvtColor(picture, module.COLOR_BGR2GRAY)


WAIT = 0.2  # s for a picture before the loop looks whether it should end
KEPT = 100_000  # sightings, an hour
LATENCY = 0.04  # s from a virtual picture being taken to its being there


class Eyes(Protocol):
    """Who sees the robot."""

    tracker: Tracker

    def poll(self) -> list[Sighting]:
        """Sightings since the last call, in order of time.

        Raises:
            BnsError: the camera is lost.
        """
        ...

    def frame(self) -> Frame | None:
        """The newest picture."""
        ...

    def close(self) -> None:
        """Look no more."""
        ...


class ThreadedEyes:
    """A camera and a tracker in a thread of their own.

    Args:
        source: of pictures; closed with this.
        tracker: with the calibration of that camera.
    """

    def __init__(self, source: Source, tracker: Tracker):
        self.source, self.tracker = source, tracker
        self._seen: deque[Sighting] = deque(maxlen=KEPT)
        self._frame: Frame | None = None
        self._error: BnsError | None = None
        self._done = threading.Event()
        self._thread = threading.Thread(target=self._look, name="eyes", daemon=True)
        self._thread.start()

    def _look(self) -> None:
        urgent()
        try:
            while not self._done.is_set():
                frame = self.source.read(WAIT)
                if frame is None:
                    continue
                late = self.tracker.camera.latency
                frame = frame._replace(time=frame.time - late)
                self._frame = frame
                sighting = self.tracker.see(frame)
                if sighting is not None:
                    self._seen.append(sighting)
        except BnsError as error:
            self._error = error

    def poll(self) -> list[Sighting]:
        """Sightings since the last call, see `Eyes.poll`.

        Raises:
            BnsError: the camera is lost, or the tracker's thread has failed.
        """
        if self._error:
            raise BnsError(str(self._error))
        if not self._thread.is_alive() and not self._done.is_set():
            raise BnsError("The tracker has failed; look at its message above.")
        new = []
        while self._seen:
            new.append(self._seen.popleft())
        return new

    def frame(self) -> Frame | None:
        """The newest picture."""
        return self._frame

    def close(self) -> None:
        """Look no more."""
        self._done.set()
        self._thread.join(2.0)
        self.source.close()


class VirtualEyes:
    """Pictures in virtual time: as many as have become due are looked at when asked.

    Args:
        source: gives the picture taken at a time.
        tracker: looks at it.
        clock: virtual.
        rate: pictures a second.
    """

    def __init__(
        self,
        source: "Painted",
        tracker: Tracker,
        clock: VirtualClock,
        *,
        rate: float = 15.0,
    ):
        self.source, self.tracker, self.clock, self.rate = source, tracker, clock, rate
        self._count = 0
        self._frame: Frame | None = None
        self.blind = False

    def poll(self) -> list[Sighting]:
        """Sightings since the last call, see `Eyes.poll`."""
        seen = []
        while (at := self._count / self.rate) + LATENCY <= self.clock.now():
            self._count += 1
            if self.blind:
                self.tracker.missed()
                continue
            frame = Frame(at, self.source.paint_at(at), self._count)
            self._frame, sighting = frame, self.tracker.see(frame)
            if sighting is not None:
                seen.append(sighting)
        return seen

    def frame(self) -> Frame | None:
        """The newest picture."""
        return self._frame

    def close(self) -> None:
        """Nothing to give back."""


class Painted(Protocol):
    """Paints the robot as it was at a time."""

    def paint_at(self, at: float) -> np.ndarray:
        """The picture ``(H, W)`` uint8."""
        ...
