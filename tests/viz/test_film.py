"""Films: the right trials, the right length, something to see; what is refused."""

import numpy as np
import pytest

from bns.__main__ import main
from bns.errors import BnsError
from bns.viz import film, style
from bns.viz.choices import Choice

CHOICES = (Choice(1, "before damage", style.BLUE), Choice(20, "damaged", style.ORANGE))
SMALL = {"size": (96, 64), "speed": 100.0, "replicate": 0, "choices": CHOICES}


def test_a_gif_shows_each_trial(record, tmp_path, opengl):
    from PIL import Image

    path = film.write(record, {}, tmp_path / "run.gif", **SMALL)
    with Image.open(path) as image:
        assert image.size == (96, 64) and image.n_frames >= 4
        seconds = 0.0
        pictures = []
        for number in range(image.n_frames):
            image.seek(number)
            seconds += image.info["duration"] / 1000
            pictures.append(np.asarray(image.convert("RGB"), dtype=float))
    assert seconds > 2 * film.HOLD
    assert np.abs(pictures[0] - pictures[-1]).mean() > 1, "the robot has moved"


def test_an_mp4_is_written(record, tmp_path, opengl):
    pytest.importorskip("imageio_ffmpeg")
    path = film.write(record, {}, tmp_path / "run.mp4", **SMALL)
    assert path.read_bytes()[4:8] == b"ftyp"


@pytest.mark.parametrize(
    ("name", "more", "message"),
    [
        ("run.avi", {}, "ends in .gif or .mp4"),
        ("nowhere/run.gif", {}, "There is no directory"),
        ("run.gif", {"size": (97, 64)}, "give even numbers"),
        ("run.gif", {"speed": 0.0}, "give 0.1 to 100"),
    ],
)
def test_what_cannot_be_is_refused(record, tmp_path, name, more, message):
    with pytest.raises(BnsError, match=message):
        film.write(record, {}, tmp_path / name, **(SMALL | more))


@pytest.mark.parametrize(
    ("words", "message"),
    [
        (["--gif", "a.gif", "--png", "a.png"], "Give one of"),
        (["--gif", "a.mp4"], "give a name that ends in .gif"),
    ],
)
def test_wrong_words_are_one_line(words, message, capsys, tmp_path):
    assert main(["view", str(tmp_path), *words]) == 2
    said = capsys.readouterr().err
    assert message in said and said.count("\n") == 1
