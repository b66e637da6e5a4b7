"""Pictures of recordings, without a display."""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

from bns.errors import BnsError, FormatError, MissingDependencyError, install
from bns.storage import files
from bns.viz.blueprint import LIVE_TIMELINE, TRIAL_TIMELINE

LOOPBACK = "127.0.0.1"
"""where viewers listen: this machine alone can reach them"""

INSTALL = "apt-get install mesa-vulkan-drivers"
"""What a Debian system lacks when there is no Vulkan."""

_ICD = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d")
_START = 20.0
"""s for the viewer to start, and to end"""
_SETTLE = 6.0
"""s for the viewer to load the recording, draw it, and drop its welcome note"""


def save(
    rrd: str | Path, png: str | Path, *, trial: int | None = None, at: float = 0.0
) -> list[str]:
    """Draw a recording as it opens in the viewer, 1920 x 1080.

    Args:
        rrd: the recording.
        png: file to write.
        trial: show this trial on the timeline `trial`; by default the robot's
            motion on `sim_time` is shown.
        at: time on `sim_time` [s].

    Returns:
        Warnings that views of the recording reported; none if all is well.

    Raises:
        FormatError: there is no such recording.
        MissingDependencyError: the viewer or Vulkan is missing.
        BnsError: the viewer did not draw, or cannot write there.
    """
    rrd, png = Path(rrd).resolve(), Path(png).resolve()
    if not rrd.is_file():
        raise FormatError(f"{rrd} is not a recording: there is no such file.")
    if png.suffix.lower() != ".png":
        raise BnsError(f"{png.name} is no PNG: give a name that ends in .png.")
    files.check_writable(png)
    with viewer() as shown:
        shown.open(str(rrd))
        _go(shown, trial, at)
        time.sleep(_SETTLE)
        files.replace(png, lambda beside: _photograph(shown, beside))
        reports = [
            f"{view.name}: {report}"
            for view in shown.get_state().views
            for report in view.reports
        ]
    return reports


def _photograph(shown: Any, png: Path) -> None:
    """Have the viewer write a picture, all of it.

    Raises:
        BnsError: it did not.
    """
    shown.save_screenshot(str(png))
    whole = png.is_file() and png.read_bytes()[-8:-4] == b"IEND"
    if not whole:
        raise BnsError(f"The viewer wrote no picture to {png}; is there disk space?")


def missing() -> MissingDependencyError | None:
    """What keeps `save` from working here, or None."""
    if executable() is None:
        return MissingDependencyError(
            "A picture of a recording", "the Rerun viewer", install("view")
        )
    if sys.platform == "linux" and not _vulkan():
        return MissingDependencyError(
            "A picture of a recording without a display", "a Vulkan driver", INSTALL
        )
    return None


def executable() -> str | None:
    """Path of the viewer that belongs to this Python.

    The program itself, not the script of that name, which starts it as another process
    that stays when the script is ended.
    """
    package = find_spec("rerun_cli")
    if package is None or package.origin is None:
        return None
    name = "rerun.exe" if sys.platform == "win32" else "rerun"
    path = Path(package.origin).parent / name
    return str(path) if path.is_file() else None


def free_port(wanted: int = 0) -> int:
    """A TCP port that nothing listens on at this moment.

    Args:
        wanted: the port to give where it is free; 0 = any.
    """
    with socket.socket() as probe:
        probe.setsockopt(socket.SOL_SOCKET, socket.SO_REUSEADDR, 1)
        try:
            probe.bind(("127.0.0.1", wanted))
        except OSError:
            if not wanted:
                raise
            return free_port()
        return probe.getsockname()[1]


def _vulkan() -> bool:
    named = os.environ.get("VK_DRIVER_FILES") or os.environ.get("VK_ICD_FILENAMES")
    if named:
        return any(Path(part).is_file() for part in named.split(os.pathsep))
    return any(any(Path(place).glob("*.json")) for place in _ICD)


def _go(viewer: Any, trial: int | None, at: float) -> None:
    if trial is None:
        viewer.set_time(LIVE_TIMELINE, duration=at, play_state="paused")
    else:
        viewer.set_time(TRIAL_TIMELINE, sequence=trial, play_state="paused")


@contextmanager
def viewer() -> Iterator:
    """A headless viewer that only this machine can reach; gone afterwards.

    Raises:
        MissingDependencyError: the viewer or Vulkan is missing.
        BnsError: it did not start, or did not answer.
    """
    problem = missing()
    if problem:
        raise problem
    from rerun.experimental import ViewerClient

    port = free_port()
    command = [str(executable()), "--headless", "--bind", LOOPBACK, "--port", str(port)]
    environment = os.environ | {"RERUN_ANALYTICS": "0"}
    with TemporaryFile() as said:
        process = subprocess.Popen(
            [*command, "--hide-welcome-screen"],
            env=environment,
            stdout=said,
            stderr=said,
        )
        try:
            wait(process, port)
            yield ViewerClient.connect(f"rerun+http://127.0.0.1:{port}/proxy")
        except (RuntimeError, ConnectionError, TimeoutError) as error:
            raise _explain(error, said) from error
        finally:
            process.terminate()
            process.wait(timeout=_START)


def wait(process: subprocess.Popen, port: int) -> None:
    """Wait until the viewer listens.

    Raises:
        RuntimeError: it ended.
        TimeoutError: it did not start in time.
    """
    until = time.monotonic() + _START
    while time.monotonic() < until:
        if process.poll() is not None:
            raise RuntimeError(f"it ended with exit code {process.returncode}")
        with socket.socket() as probe:
            if probe.connect_ex(("127.0.0.1", port)) == 0:
                return
        time.sleep(0.05)
    raise TimeoutError(f"it did not start within {_START:g} s")


def _explain(error: Exception, said: Any) -> BnsError:
    """What failed, as an error of ours."""
    said.seek(0)
    if b"panicked at" in said.read():
        return MissingDependencyError(
            "A picture of a recording without a display", "a working Vulkan", INSTALL
        )
    return BnsError(f"The Rerun viewer did not draw: {error}. Try again.")
