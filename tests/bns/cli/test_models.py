"""`bns models` as a user drives it."""

import re
import shutil

import pytest

from bns.__main__ import main
from tests.sources import ROOT


def said(capsys, *argv) -> tuple[int, str]:
    code = main([*map(str, argv)])
    out = capsys.readouterr()
    return code, out.out + out.err


def test_a_robot_is_drawn(capsys, tmp_path, opengl):
    from matplotlib.image import imread

    file = tmp_path / "robot.png"
    words = ("models", "view", "phantomx", "--png", file, "--width", 96, "--height", 64)
    code, text = said(capsys, *words)
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
        (["check", "nowhere"], "Or give a directory that holds a robot.toml"),
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


SIZES = ["--wheel-radius=0.02", "--axle-length=0.053", "--mass=0.16", "--top-speed=0.1"]


def test_a_robot_is_made_of_its_numbers(capsys, tmp_path):
    mine = tmp_path / "robots" / "mine"
    code, text = said(capsys, "models", "new", mine, *SIZES)
    assert code == 0 and "13 of 13 points hold." in text
    code, text = said(capsys, "models", "new", mine, *SIZES)
    assert code == 2 and "is there already" in text
    run = ("run", "khepera-simple", "--world.robot", mine, "--out", tmp_path / "run")
    code, text = said(capsys, *run)
    assert code == 2 and "--controller.speed-high 14401 " in text
    assert not (tmp_path / "run").exists()


@pytest.mark.parametrize(
    "place, changed, expected",
    [
        ("my robot", (), "cannot be a robot's name"),
        ("khepera3", (), "'khepera3' is the name of a robot already"),
        ("mine", ("--mass", "0"), "mass = 0.0 kg is not allowed"),
        ("mine", ("--height", "-1"), "height = -1.0 m is not allowed"),
        ("mine", ("--top-speed", "nan"), "top_speed = nan m/s is not allowed"),
        ("mine", ("--wheel-radius", "33"), "give a number from 0.001 to 2 m"),
        ("mine", ("--wheel-radius", "1.5"), "do not go on an axle"),
    ],
)
def test_what_no_robot_can_be_is_not_made(capsys, tmp_path, place, changed, expected):
    code, text = said(capsys, "models", "new", tmp_path / place, *SIZES, *changed)
    assert code == 2 and expected in text and text.count("\n") == 1
    assert not any(tmp_path.iterdir())


def law(file, table):
    """Write servos' law of one number that is 100 V."""
    rest = 'value = 100\nunit = "V"\nbasis = "assumed"\nsource = "a test"\n'
    file.write_text(f"[{table}]\n{rest}")
    return file


LEGS = ["--legs=4", "--mass=1.5", "--body-length=0.16", "--body-width=0.1",
        "--coxa-length=0.05", "--femur-length=0.07", "--tibia-length=0.13"]  # fmt: skip


def test_a_walker_is_made_of_its_numbers(capsys, tmp_path):
    mine = tmp_path / "mine"
    code, text = said(capsys, "models", "new-legged", mine, *LEGS)
    assert code == 0 and "13 of 13 points hold." in text
    assert "wheeled robot" not in text and "walking robot's legs" in text
    assert "--out runs/mine\n" in text
    told = re.search(r"bns (run hexapod-walk .*) --out", text)[1].split()
    small = ("--trials=1", "--replicates=1", "--rerun=off", "--no-report")
    code, text = said(capsys, *told, *small, "--out", tmp_path / "run")
    assert code == 0


@pytest.mark.parametrize(
    "place, changed, expected",
    [
        ("my robot", (), "cannot be a robot's name"),
        ("mine", ("--legs", "5"), "Give 4 or 6."),
        ("mine", ("--mass", "9"), "too weak for this robot"),
        ("mine", ("--servo", "ax12"), "neither ax12a nor a file"),
        ("mine", ("--servo", "{law}"), "servo voltage = 100.0 V is not allowed"),
    ],
)
def test_what_no_walker_can_be_is_not_made(capsys, tmp_path, place, changed, expected):
    file = law(tmp_path / "law.toml", "voltage")
    words = [word.format(law=file) for word in changed]
    code, text = said(capsys, "models", "new-legged", tmp_path / place, *LEGS, *words)
    assert code == 2 and expected in text and text.count("\n") == 1
    assert list(tmp_path.iterdir()) == [file]


@pytest.mark.parametrize(
    "table, expected", [("voltage", "servo voltage = 100.0 V"), ("volts", "'volts'")]
)
def test_servos_that_no_world_can_have_are_found(capsys, tmp_path, table, expected):
    mine = tmp_path / "quad"
    shutil.copytree(ROOT / "examples" / "quad", mine)
    text = (mine / "robot.toml").read_text()
    (mine / "robot.toml").write_text(text.replace('"ax12a"', '"law.toml"'))
    law(mine / "law.toml", table)
    code, text = said(capsys, "models", "check", mine)
    assert code == 2 and expected in text and text.count("\n") == 1


def test_without_a_display_it_says_what_to_do(capsys, monkeypatch):
    monkeypatch.setattr("sys.platform", "linux")
    monkeypatch.delenv("DISPLAY", raising=False)
    monkeypatch.delenv("WAYLAND_DISPLAY", raising=False)
    code, text = said(capsys, "models", "view", "phantomx")
    assert code == 2 and "--png FILE" in text
