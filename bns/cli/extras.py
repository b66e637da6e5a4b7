"""Packages that parts of the testbed need, and what happens where one is missing."""

import sys
from collections.abc import Callable
from pathlib import Path

from bns.errors import BnsError, install

EXTRAS = {
    "torch": "learn",
    "matplotlib": "report",
    "pyarrow": "tables",
    "rerun": "view",
    "gymnasium": "gym",
    "dm_env": "dm",
    "mcap": "mcap",
    "ray": "ray",
    "serial": "hardware",
    "cv2": "hardware",
    "dynamixel_sdk": "hardware",
    "imageio_ffmpeg": "video",
}
"""module that may be missing -> extra of bns-testbed that brings it"""


def missing(error: ModuleNotFoundError) -> str:
    """What to do about a module that is not installed; "" where it is not ours to say.

    Args:
        error: that was raised by its import.
    """
    name = (error.name or "").partition(".")[0]
    if name not in EXTRAS:
        return ""
    return f"This needs {name}: {install(EXTRAS[name])}"


def attempt(name: str, make: Callable[[], Path]) -> dict[str, Path]:
    """What `make` wrote, by name; nothing, and a line that says why, where it failed.

    A picture that cannot be made must not take the data with it.
    """
    try:
        return {name: make()}
    except (BnsError, OSError) as error:
        why = str(error)
    except ModuleNotFoundError as error:
        why = missing(error)
        if not why:
            raise
    print(f"bns: no {name}: {why}", file=sys.stderr)
    return {}
