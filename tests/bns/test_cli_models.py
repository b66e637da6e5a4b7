"""`bns models` as a user drives it."""

import shutil

import pytest

from bns.__main__ import main
from tests.sources import ROOT


def said(capsys, *argv) -> tuple[int, str]:
    code = main([*map(str, argv)])
    out = capsys.readouterr()
    return code, out.out + out.err


def test_a_robot_is_drawn(capsys, tmp_path):
    from matplotlib.image import imread

    file = tmp_path / "robot.png"
    words = ("models", "view", "phantomx", "--png", file, "--width", 96, "--height", 64)
    code, text = said(capsys, *words)
    if "needs OpenGL" in text:
        pytest.skip("this machine can not render")
    assert code == 0 and text.strip() == str(file)
    picture = imread(file)
    assert picture.shape[:2] == (64, 96) and picture.std() > 0.1


def test_a_robot_is_checked(capsys, tmp_path):
    code, text = said(capsys, "models", "check", ROOT / "examples" / "burger")
    assert code == 0 and text.endswith("13 of 13 points hold.\n")
    mine = shutil.copytree(ROOT / "examples" / "burger", tmp_path / "burger")
    file = mine / "burger.xml"
    file.write_text(file.read_text().replace('name="home"', 'name="rest"'))
    code, text = said(capsys, "models", "check", mine)
    assert code == 2
    assert "fault  what robot.toml names" in text and "called 'home'" in text
    assert "2 of 3 points hold, 10 not looked at because of that." in text


@pytest.mark.parametrize(
    "words, expected",
    [
        (["check", "."], "./ holds no robot.toml"),
        (["check", "khepera"], "Or give a directory that holds a robot.toml"),
        (["view", "phantom", "--png", "x.png"], "Did you mean 'phantomx'"),
        (["view", "phantomx", "--png", "x.jpg"], "ends in .png"),
        (["view", "phantomx", "--png", "nowhere/x.png"], "no directory nowhere"),
        (["view", "phantomx", "--png", "x.png", "--width", "2"], "2 x 640 px"),
        (["show", "phantomx"], "verb of `bns models` 'show'"),
        (["view"], "bns models view --help"),
    ],
)
def test_wrong_words_are_one_line(capsys, words, expected):
    code, text = said(capsys, "models", *words)
    assert code == 2 and expected in text and text.count("\n") == 1


def test_without_a_display_it_says_what_to_do(capsys, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    code, text = said(capsys, "models", "view", "phantomx")
    assert code == 2 and "--png FILE" in text
