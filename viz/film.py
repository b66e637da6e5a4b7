"""Films of the trials that tell a run's story, as GIF or MP4, without a display."""

from collections.abc import Iterator, Mapping, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from bns.errors import BnsError
from bns.experiment.record import RunRecord
from bns.models import render
from bns.progress import Bar
from bns.viz import moments, scene, style
from bns.viz.choices import Choice, choose, typical
from bns.worlds.trial import Trial

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


def write(
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
