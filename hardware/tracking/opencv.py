"""OpenCV, imported where it is needed and asked for in words where it is missing."""

from typing import Any

from bns.errors import MissingDependencyError, install


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
