"""Pictures and films of runs, without a display.

A film shows the trials that tell a run's story, as GIF or MP4; a picture is that of a
recording in Rerun's viewer, as PNG.
"""

import os
import socket
import subprocess
import sys
import time
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib.util import find_spec
from pathlib import Path
from tempfile import TemporaryFile
from typing import Any

import numpy as np

from bns.errors import BnsError, FormatError, MissingDependencyError, install
from bns.experiment.record import RunRecord
from bns.models import render
from bns.progress import Bar
from bns.storage import files
from bns.viz import moments, scene, style
from bns.viz.choices import Choice, choose, typical
from bns.viz.rrd import LIVE_TIMELINE
from bns.worlds.trial import Trial

LOOPBACK = "127.0.0.1"
"""where viewers listen: this machine alone can reach them"""

INSTALL = "apt-get install mesa-vulkan-drivers"
"""What a Debian system lacks when there is no Vulkan."""

_ICD = ("/usr/share/vulkan/icd.d", "/etc/vulkan/icd.d")
_START = 20.0
"""s for the viewer to start, and to end"""
_SETTLE = 6.0
"""s for the viewer to load the recording, draw it, and drop its welcome note"""


def write_png(rrd: str | Path, png: str | Path) -> list[str]:
    """Draw a recording as it opens in the viewer, 1920 x 1080.

    Args:
        rrd: the recording.
        png: file to write.

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
        shown.set_time(LIVE_TIMELINE, duration=0.0, play_state="paused")
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
    """What keeps `write_png` from working here, or None."""
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


FORMATS = (".gif", ".mp4")
RATE = {".gif": 10.0, ".mp4": 20.0}
"""frames a second; GIFs count in hundredths of a second"""
CAMERA = "perspective"
HOLD = 0.8
"""time for which the last frame of a trial stays [s]"""
TRAIL = 0.004
"""half the width of a trail [m]"""
DISC = 0.001
"""half the height of an objective [m]"""


def write_film(
    record: RunRecord,
    trials: Mapping[int, Trial],
    path: str | Path,
    *,
    replicate: int | None = None,
    choices: Sequence[Choice] | None = None,
    speed: float = 8.0,
    size: tuple[int, int] = (480, 320),
) -> Path:
    """Write a film of chosen trials, one after another.

    Args:
        record: the batch.
        trials: densely sampled trials of the replicate, by number; one that is missing
            is drawn from the poses at its commands' ends.
        path: file to write, `.gif` or `.mp4`.
        replicate: which run; by default the typical one.
        choices: which trials; by default before, just after and recovered.
        speed: times real time.
        size: width and height [px], even numbers.

    Returns:
        The path written.

    Raises:
        BnsError: another kind of file, a size or speed that cannot be, nothing to show.
        MissingDependencyError: this machine cannot render.
    """
    path = Path(path)
    _check(path, size, speed)
    replicate = typical(record) if replicate is None else replicate
    chosen = tuple(choices) if choices is not None else choose(record, replicate)
    rate = RATE[path.suffix]
    shots = [
        (choice, *_sampled(record, replicate, choice, trials, rate / speed))
        for choice in chosen
    ]
    shots = [shot for shot in shots if len(shot[1])]
    if not shots:
        raise BnsError("No pose was recorded in these trials, so there is no film.")
    total = sum(len(qpos) for _, _, qpos in shots)
    with Bar(path.name, total) as bar:
        frames = _counted(_frames(record, shots, size, int(HOLD * rate)), bar)
        (_write_gif if path.suffix == ".gif" else _write_mp4)(path, frames, size, rate)
    return path


def _check(path: Path, size: tuple[int, int], speed: float) -> None:
    if path.suffix not in FORMATS:
        raise BnsError(f"{path} is no film: give a name that ends in .gif or .mp4.")
    if not path.parent.is_dir():
        raise BnsError(f"There is no directory {path.parent} for {path.name}: make it.")
    if not all(32 <= side <= 1920 and side % 2 == 0 for side in size):
        raise BnsError(
            f"A film of {size[0]} x {size[1]} px is not possible: give even numbers "
            "from 32 to 1920."
        )
    if not 0.1 <= speed <= 100:
        raise BnsError(f"speed = {speed} is not allowed: give 0.1 to 100.")


def _sampled(
    record: RunRecord,
    replicate: int,
    choice: Choice,
    trials: Mapping[int, Trial],
    rate: float,
) -> tuple[np.ndarray, np.ndarray]:
    """Base poses ``(S, 3)`` and qpos ``(S, nq)`` of a trial, `rate` a second of it."""
    model = scene.compiled(record.config.world.robot)
    at = (replicate, choice.trial)
    times, poses, qpos = moments.samples(record, at, trials.get(choice.trial), model)
    if not len(times):
        return poses, qpos
    wanted = np.arange(0.0, times[-1] + 1e-9, 1.0 / rate)
    rows = np.searchsorted(times, wanted - 1e-9).clip(max=len(times) - 1)
    return poses[rows], qpos[rows]


def _frames(
    record: RunRecord,
    shots: Sequence[tuple[Choice, np.ndarray, np.ndarray]],
    size: tuple[int, int],
    hold: int,
) -> Iterator[tuple[int, np.ndarray]]:
    """Frames with how often each is shown."""
    model = scene.compiled(record.config.world.robot)
    with render.film(model, camera=CAMERA, size=size) as draw:
        for choice, poses, qpos in shots:
            colour = np.array([*style.rgb(choice.colour), 255]) / 255.0
            for row, state in enumerate(qpos):
                picture = draw(
                    state,
                    discs=_discs(record),
                    trail=(poses[: row + 1, :2], colour, TRAIL),
                )
                last = row == len(qpos) - 1
                said = f"trial {choice.trial}: {choice.label}"
                yield 1 + hold * last, _titled(picture, said, choice.colour)


def _discs(record: RunRecord) -> list[tuple[float, float, float, float]]:
    """x, y, radius and half height of the objectives [m]."""
    shown = scene.picture(record.config)
    places = shown.objectives.values()
    return [(float(at[0]), float(at[1]), shown.radius, DISC) for at in places]


def _titled(picture: np.ndarray, text: str, colour: str) -> np.ndarray:
    from PIL import Image, ImageDraw, ImageFont

    image = Image.fromarray(picture)
    font = ImageFont.load_default(size=max(12, picture.shape[0] // 20))
    drawn = ImageDraw.Draw(image)
    drawn.text(
        (10, 8), text, fill=colour, font=font, stroke_width=3, stroke_fill="white"
    )
    return np.asarray(image)


def _counted(
    frames: Iterator[tuple[int, np.ndarray]], bar: Bar
) -> Iterator[tuple[int, np.ndarray]]:
    for number, frame in enumerate(frames, 1):
        bar.update(number)
        yield frame


def _write_gif(
    path: Path, frames: Iterator, size: tuple[int, int], rate: float
) -> None:
    from PIL import Image

    del size
    shown, lengths = [], []
    for times, frame in frames:
        image = Image.fromarray(frame)
        shown.append(image.quantize(colors=128, dither=Image.Dither.NONE))
        lengths.append(round(1000 * times / rate))
    first, *rest = shown
    first.save(path, save_all=True, append_images=rest, duration=lengths, loop=0)


def _write_mp4(
    path: Path, frames: Iterator, size: tuple[int, int], rate: float
) -> None:
    import imageio_ffmpeg

    writer: Any = imageio_ffmpeg.write_frames(
        str(path), size, fps=rate, macro_block_size=2, codec="libx264", quality=7
    )
    writer.send(None)
    try:
        for times, frame in frames:
            for _ in range(times):
                writer.send(np.ascontiguousarray(frame))
    finally:
        writer.close()
