"""Where pictures come from: a camera, a video file."""

import time
from pathlib import Path
from typing import Any, Protocol

from bns.errors import BnsError
from bns.hardware.tracking.opencv import cv2
from bns.hardware.tracking.tracker import Frame


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
