"""`bns view`, with and without what it needs."""

import socket
import subprocess
import sys

import pytest

from bns.__main__ import WRONG_INPUT, main
from bns.cli import outputs
from bns.storage.store import load
from bns.viz import pictures


def test_view_without_a_display_says_what_to_do(said, tmp_path, monkeypatch):
    for name in ("DISPLAY", "WAYLAND_DISPLAY"):
        monkeypatch.delenv(name, raising=False)
    monkeypatch.setattr(sys, "platform", "linux")
    (tmp_path / "x.rrd").write_bytes(b"")
    text = said("view", tmp_path / "x.rrd", code=WRONG_INPUT)
    assert "No display" in text and "--png FILE" in text


@pytest.fixture
def no_rerun(monkeypatch):
    """As where the extra `view` is not installed; gives the command that adds it."""
    monkeypatch.setitem(sys.modules, "rerun", None)
    return "pip install 'bns-testbed[view]'"


@pytest.mark.parametrize("words", [[], ["--web"], ["--png", "a.png"]], ids=str)
def test_view_without_rerun_says_what_to_install(said, run, no_rerun, words):
    text = said("view", run, *words, code=WRONG_INPUT)
    assert no_rerun in text and text.count("\n") == 1
    assert not (run / "recording.rrd").exists()


def test_a_run_without_rerun_says_how_to_look_at_it_in_3d(capsys, run, no_rerun):
    outputs.write(load(run), run, report=False)
    said = capsys.readouterr()
    (line,) = (line for line in said.out.splitlines() if line.startswith("in 3D:"))
    assert line.endswith(f"{no_rerun}, then bns view {run}") and not said.err
    outputs.write(load(run), run, report=False, recording=False)
    assert "in 3D" not in capsys.readouterr().out


def test_view_of_a_diagnosis(said, tmp_path):
    from bns.cli import view
    from bns.gap.store import FILE

    (tmp_path / FILE).write_text("{}")
    text = said("view", tmp_path, code=WRONG_INPUT)
    assert "diagnosis without a recording" in text
    (tmp_path / "recording.rrd").write_bytes(b"")
    assert view.find(tmp_path) == tmp_path / "recording.rrd"


@pytest.mark.parametrize(
    ("words", "address"),
    [([], "127.0.0.1"), (["--web"], "127.0.0.1"), (["--bind", "0.0.0.0"], "0.0.0.0")],
)
def test_a_view_listens_on_this_machine_alone_unless_asked(
    words, address, tmp_path, monkeypatch
):
    called = []
    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(pictures, "executable", lambda: "viewer")
    monkeypatch.setattr(subprocess, "call", lambda given: called.append(given) or 0)
    recording = tmp_path / "a.rrd"
    recording.write_bytes(b"")
    assert main(["view", str(recording), *words]) == 0
    (given,) = called
    assert given[given.index("--bind") + 1] == address and given.count("--bind") == 1


def test_a_second_view_in_a_browser_has_ports_of_its_own(said, tmp_path, monkeypatch):
    from bns.cli import view

    called = []
    monkeypatch.setattr(pictures, "executable", lambda: "viewer")
    monkeypatch.setattr(subprocess, "call", lambda given: called.append(given) or 0)
    recording = tmp_path / "a.rrd"
    recording.write_bytes(b"")
    free = pictures.free_port()
    with socket.socket() as taken:
        taken.bind(("127.0.0.1", 0))
        taken.listen()
        monkeypatch.setattr(view, "DATA", taken.getsockname()[1])
        monkeypatch.setattr(view, "PAGE", free)
        text = said("view", recording, "--web")
    (given,) = called
    data = int(given[given.index("--port") + 1])
    assert data != view.DATA
    assert given[given.index("--web-viewer-port") + 1] == str(free)
    assert f"http://127.0.0.1:{free}?url=rerun" in text and f"{data}%2Fproxy" in text


def test_a_view_on_no_address_says_what_is_one(said, tmp_path, monkeypatch):

    monkeypatch.setenv("DISPLAY", ":0")
    monkeypatch.setattr(pictures, "executable", lambda: "viewer")
    recording = tmp_path / "a.rrd"
    recording.write_bytes(b"")
    text = said("view", recording, "--bind", "localhost:1", code=WRONG_INPUT)
    assert "give 127.0.0.1" in text
