"""Setting a robot up: which port it is, the file, and a rehearsal of all of it."""

import io
import time
from contextlib import contextmanager

import pytest

from bns.__main__ import WRONG_INPUT, main
from bns.errors import BnsError, FormatError
from bns.hardware import setup
from bns.worlds.data import dataset

pytest.importorskip("serial")

from bns.hardware import line
from bns.hardware.emulators.khepera import KheperaBody, KheperaDevice
from bns.hardware.emulators.pty_host import PtyHost


@pytest.fixture
def asked(tmp_path, monkeypatch):
    """Answers the questions of a command in an empty directory, a line each."""
    monkeypatch.chdir(tmp_path)
    monkeypatch.setattr(line, "ports", lambda: {"/dev/rfcomm0": "Bluetooth"})

    def ask(words, *answers):
        monkeypatch.setattr(
            "sys.stdin", io.StringIO("".join(f"{a}\n" for a in answers))
        )
        return main(["hardware", *words])

    return ask


def test_the_wizard_writes_what_was_answered_and_what_it_means(asked, capsys, tmp_path):
    (tmp_path / "camera.json").write_text("{}")
    assert asked(["setup"], "", "/dev/ttyUSB0", "1", "", "") == 0
    text = (tmp_path / "hardware.toml").read_text()
    found = setup.read(tmp_path / "hardware.toml")
    assert (found.robot, found.port, found.camera) == ("khepera3", "/dev/ttyUSB0", "1")
    assert found.calibration == str(tmp_path / "camera.json") and not found.wheels
    shown = capsys.readouterr().out
    for why in ("Bluetooth", "camera's lens and place"):
        assert why in text and why in shown
    assert "found /dev/rfcomm0" in shown
    assert "bns hardware check --setup hardware.toml" in shown


def test_it_takes_what_it_found_and_asks_again_where_an_answer_cannot_be(
    asked, capsys, tmp_path
):
    assert asked(["setup"], "spot", "phantomx", "", "no.mp4", "emulated", "x", "") == 0
    shown = capsys.readouterr().out
    assert "'spot' is none: khepera3 or phantomx" in shown
    assert "give a number, a video file that is there, or emulated" in shown
    assert "There is no file x" in shown
    found = setup.read(tmp_path / "hardware.toml")
    assert (found.robot, found.port, found.camera) == (
        "phantomx",
        "/dev/rfcomm0",
        "emulated",
    )
    assert asked(["setup"], "") == WRONG_INPUT  # it is there
    assert "--force" in capsys.readouterr().err
    assert asked(["setup", "--force"], "khepera3") == WRONG_INPUT
    assert "The answers ended at 'Its port?'" in capsys.readouterr().err
    assert setup.read(tmp_path / "hardware.toml") == found


def test_none_leaves_out_what_stands_in_brackets(asked, capsys, tmp_path):
    (tmp_path / "camera.json").write_text("{}")
    assert asked(["setup"], "", "/dev/ttyUSB9", "1", "none", "None") == 0
    found = setup.read(tmp_path / "hardware.toml")
    assert found.calibration == found.wheels == ""
    shown = capsys.readouterr().out
    assert "there is no /dev/ttyUSB9 now" in shown
    assert 'calibration = "camera.json"' in shown


def test_ports_that_machines_have_anyway_come_last(tmp_path, monkeypatch):
    from serial.tools import list_ports
    from serial.tools.list_ports_common import ListPortInfo

    devices = ["/dev/ttyS0", "/dev/ttyUSB0", "/dev/rfcomm0"]
    there = [ListPortInfo(device, skip_link_detection=True) for device in devices]
    there[1].description = "FT232R"
    monkeypatch.setattr(list_ports, "comports", lambda: there)
    (tmp_path / "bns-robot").touch()
    (tmp_path / "bns-robot.mishaps").touch()
    assert list(line.ports(tmp_path).values()) == [
        "an emulated robot",
        "Bluetooth",
        "FT232R",
        "built into this machine",
    ]


def test_verbs_take_a_set_up_and_what_they_are_told_goes_before(
    asked, tmp_path, capsys
):
    file = tmp_path / "hardware.toml"
    file.write_text('port = "/nowhere/a"\n')
    assert main(["hardware", "check", "--setup", str(file)]) == WRONG_INPUT
    assert "/nowhere/a" in capsys.readouterr().err
    words = ["hardware", "check", "--setup", str(file), "--port", "/nowhere/b"]
    assert main(words) == WRONG_INPUT
    assert "/nowhere/b" in capsys.readouterr().err
    run = ["run", "hexapod-walk", "--world", "hardware", "--setup", str(file)]
    assert main([*run, "--out", str(tmp_path / "run")]) == WRONG_INPUT
    assert "is of khepera3, this needs phantomx" in capsys.readouterr().err
    run[1] = "khepera-simple"
    assert main([*run, "--out", str(tmp_path / "run")]) == WRONG_INPUT
    assert "/nowhere/a" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ('prot = "x"', "unknown field"),
        ('robot = "spot"', "Invalid enum value"),
        ('calibration = "no.json"', "there is no file"),
    ],
)
def test_a_set_up_that_is_wrong_is_told(tmp_path, text, said):
    (tmp_path / "a.toml").write_text(text)
    with pytest.raises((BnsError, FormatError), match=said):
        setup.read(tmp_path / "a.toml")


def test_the_port_of_the_robot_is_the_one_that_went(asked, capsys, monkeypatch):
    assert asked(["find-port"]) == 0
    assert "/dev/rfcomm0  Bluetooth" in capsys.readouterr().out
    both = {"/dev/ttyUSB0": "adapter", "/dev/ttyS0": "n/a"}
    left = iter([both, {"/dev/ttyS0": "n/a"}, both, both, {}])
    monkeypatch.setattr(line, "ports", lambda: next(left))
    assert asked(["find-port"], "") == 0
    assert "/dev/ttyUSB0 is the robot's" in capsys.readouterr().out
    assert asked(["find-port"], "") == WRONG_INPUT
    assert "0 ports have gone, not one" in capsys.readouterr().err
    assert asked(["find-port"]) == WRONG_INPUT
    assert "no serial port" in capsys.readouterr().err


def test_a_port_is_asked_who_it_is(tmp_path, serving):
    port = tmp_path / "robot"
    body = KheperaBody(at=time.monotonic())
    host = PtyHost(KheperaDevice(body, version=(2, 5), latency=0.0), port)
    with serving(host):
        assert line.answers(str(port)) == "khepera3, firmware 2.5"
    assert line.answers(str(tmp_path / "none")).startswith("There is no port")


def test_a_rehearsal_ends_with_a_diagnosis(tmp_path, monkeypatch, capsys):
    pytest.importorskip("cv2")
    from bns.cli.gap import diagnose as gap_diagnose
    from bns.cli.hardware import setup as hardware_setup
    from bns.hardware import rig
    from bns.hardware.emulators import run
    from bns.hardware.worlds import wheeled as world

    told = []

    @contextmanager
    def emulated(robot, effects, seed):
        told.append((robot, effects))
        yield "port"

    def connect(*_, **__):
        return run.rig(told[0][1])

    monkeypatch.setattr(hardware_setup, "emulated", emulated)
    monkeypatch.setattr(rig, "connect", connect)
    monkeypatch.setattr(world, "connect", connect)
    diagnosed = []
    monkeypatch.setattr(
        gap_diagnose, "main", lambda verb, words: diagnosed.append((verb, words)) or 0
    )
    out = tmp_path / "rehearsal"
    words = ["hardware", "rehearse", "--trials", "2", "--commands", "3"]
    assert main([*words, "--out", str(out)]) == 0
    shown = capsys.readouterr().out
    assert [f"{step} of 4" in shown for step in (1, 2, 3, 4)] == [True] * 4
    assert "Wrong with it was: wheel_gain:wheel=left,factor=0.8" in shown
    ((verb, given),) = diagnosed
    assert verb == "diagnose" and given[0] == str(out / "recording")
    assert len(dataset.read(out / "recording")) == 2
    assert main([*words, "--out", str(out)]) == WRONG_INPUT
