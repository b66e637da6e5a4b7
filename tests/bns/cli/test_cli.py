"""The command line, driven with right and wrong input."""

import json
import os
import re
import signal
import sys
import tomllib
import warnings
from functools import reduce

import numpy as np
import pytest

from bns import presets
from bns.__main__ import INTERRUPTED, SPINS, WRONG_INPUT, main
from bns.cli import VERBS
from bns.cli.outputs import sentence
from bns.cli.results import span
from bns.cli.run import STOPPED, until_interrupted
from bns.doctor import OPTIONAL, pins
from bns.errors import EXTRAS, install
from bns.storage.store import load

TINY = [
    "--trials", "3", "--replicates", "2", "--record-replicates", "1",
    "--evolution.population", "8", "--evolution.generations", "1",
    "--snn.epochs", "2", "--compiled", "no", "--threads", "1",
]  # fmt: skip


@pytest.mark.parametrize("verb", VERBS)
def test_every_help_is_a_manual(capsys, verb):
    with pytest.raises(SystemExit) as end:
        main([verb, "--help"])
    assert not end.value.code
    assert f"usage: bns {verb}" in capsys.readouterr().out


@pytest.mark.parametrize("argv", [[], ["--help"], ["-h"]])
def test_help_lists_every_verb(said, argv):
    text = said(*argv)
    assert all(f"  {verb} " in text for verb in VERBS)


def test_version(said):
    assert said("--version") == "bns 0.2.0\n"


@pytest.mark.parametrize("name", EXTRAS)
def test_a_package_that_is_missing_is_named_with_its_extra(said, monkeypatch, name):
    def missing(argv):
        raise ModuleNotFoundError(f"No module named {name!r}", name=f"{name}.part")

    monkeypatch.setattr("bns.__main__.dispatch", missing)
    text = said("doctor", code=WRONG_INPUT)
    assert text.count("\n") == 1
    assert f"pip install 'bns-testbed[{EXTRAS[name]}]'" in text


def test_the_extras_exist(root):
    known = tomllib.loads((root / "pyproject.toml").read_text())["project"]
    assert set(EXTRAS.values()) <= set(known["optional-dependencies"])
    assert {entry.extra for entry in OPTIONAL} <= set(known["optional-dependencies"])


def test_a_module_of_ours_that_is_missing_is_a_fault_of_ours(monkeypatch):
    def missing(argv):
        raise ModuleNotFoundError("No module named 'bns.nothing'", name="bns.nothing")

    monkeypatch.setattr("bns.__main__.dispatch", missing)
    with pytest.raises(ModuleNotFoundError):
        main(["doctor"])


def test_threads_that_wait_leave_the_cores_to_others(said, monkeypatch):
    monkeypatch.delenv("GOMP_SPINCOUNT", raising=False)
    said("--version")
    assert os.environ["GOMP_SPINCOUNT"] == SPINS
    monkeypatch.setenv("GOMP_SPINCOUNT", "7")  # a user's own stays
    said("--version")
    assert os.environ["GOMP_SPINCOUNT"] == "7"


def test_what_a_library_warns_of_is_a_line_without_our_code(
    capsys, monkeypatch, tmp_path
):
    monkeypatch.setattr(warnings, "showwarning", warnings.showwarning)
    old = '<mujoco><compiler settotalmass="2"/><worldbody><geom size="1"/></worldbody>'
    (tmp_path / "old.xml").write_text(old + "</mujoco>")
    (tmp_path / "log.csv").write_text("time,a\n0,0\n0.1,0\n")
    words = [str(tmp_path / name) for name in ("old.xml", "log.csv")]
    assert main(["gap", "describe", *words]) == WRONG_INPUT
    shown = capsys.readouterr().err.splitlines()
    assert shown[0].startswith("note: compiler attribute 'settotalmass'")
    assert all(line.startswith(("note: ", "bns: ")) for line in shown)


def test_help_of_a_preset_shows_its_values(capsys):
    with pytest.raises(SystemExit):
        main(["run", "demo", "--help"])
    text = " ".join(capsys.readouterr().out.split())
    assert f"(default: {presets.load('demo').replicates})" in text
    with pytest.raises(SystemExit):
        main(["run", "demo", "--help-all"])
    text = " ".join(capsys.readouterr().out.split())
    assert "an objective is reached within this distance [m]" in text


def test_the_manual_of_run_fits_a_page(capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    with pytest.raises(SystemExit):
        main(["run", "--help"])
    lines = capsys.readouterr().out.splitlines()
    assert len(lines) <= 60 and max(map(len, lines)) <= 80
    with pytest.raises(SystemExit):
        main(["run", "--help-all"])
    every = capsys.readouterr().out
    assert "--walk.limit" in every and "--servos" in every


@pytest.mark.parametrize("width", [40, 60, 120])
@pytest.mark.parametrize("verb", VERBS)
def test_a_manual_is_as_wide_as_the_terminal(capsys, monkeypatch, verb, width):
    monkeypatch.setenv("COLUMNS", str(width))
    with pytest.raises(SystemExit):
        main([verb, "--help-all"])
    text = capsys.readouterr().out
    assert "%%" not in text
    if "[options]" not in text:  # written by hand, for 80 columns or more
        width = 80
    unbroken = re.compile(r"usage:|  -")
    long = [line for line in text.splitlines() if len(line) > width]
    assert [line for line in long if not unbroken.match(line)] == []


@pytest.mark.parametrize(
    ("words", "values"),
    [
        (["--seed=3"], {"seed": 3}),
        (["--task.start_yaw", "-1e-3"], {"task.start_yaw": -1e-3}),
        (["--task.start-yaw", "-90"], {"task.start_yaw": -90.0}),
        (["--task.squared"], {"task.squared": True}),
        (["--task.no-squared"], {"task.squared": False}),
        (["--world.damage", "a@1", "b@2"], {"world.damage": ("a@1", "b@2")}),
        (["--damage"], {"world.damage": ()}),
        (["--adaptation.window", "7", "--world", "x"], {"world.name": "x"}),
    ],
)
def test_a_setting_is_read_as_it_is_written(monkeypatch, words, values):
    given = []
    monkeypatch.setattr("bns.cli.run.execute", lambda g: given.append(g.config) or 0)
    assert main(["run", "demo", *words]) == 0
    for name, value in values.items():
        found = reduce(getattr, name.split("."), given[0])
        assert found == value and type(found) is type(value)
    assert given[0].preset == "demo"


LISTS = ["presets", "learners", "tasks", "worlds", "robots", "effects"]


@pytest.mark.parametrize("verb", LISTS)
def test_lists_name_what_exists(said, verb):
    known = {
        "presets": "khepera-simple",
        "learners": "cma",
        "tasks": "infinity",
        "worlds": "static-snn",
        "robots": "khepera3",
        "effects": "wheel_gain",
    }
    assert known[verb] in said(verb)
    rows = json.loads(said(verb, "--json"))
    assert known[verb] in [next(iter(row.values())) for row in rows]
    assert all(list(row.values())[-1] for row in rows), "a line without a meaning"


def test_effects_have_units_and_ranges(said):
    rows = json.loads(said("effects", "--json"))
    names = [row["parameter"] for row in rows]
    row = rows[names.index("factor", [r["effect"] for r in rows].index("wheel_gain"))]
    assert row["unit"] == "1" and "nominal 1" in row["range"]


def test_effects_are_found_by_a_part_of_their_name_and_by_stage(said, monkeypatch):
    monkeypatch.setenv("COLUMNS", "80")
    brief = said("effects", "--stage", "tracking")
    assert "tracker_noise" in brief and "wheel_gain" not in brief
    assert "nominal" not in brief
    full = said("effects", "wheel_gain")
    assert "0 to " in full and "nominal 1" in full and "wheel_diameter" not in full
    assert max(map(len, full.splitlines())) <= 80
    rows = json.loads(said("effects", "friction", "--json"))
    assert {"floor_friction", "servo_load_friction"} <= {row["effect"] for row in rows}


@pytest.mark.parametrize("encoding", ["ascii", "utf-8"])
def test_a_bad_option_is_one_line_on_any_terminal(run_python, encoding):
    words = ["-m", "bns", "run", "demo", "--evolution.populatoin", "3"]
    text = run_python(*words, code=WRONG_INPUT, PYTHONIOENCODING=encoding)
    assert text == (
        "bns: Unknown option --evolution.populatoin. Did you mean "
        "--evolution.population?\n"
    )


def test_an_extra_is_installed_into_the_python_that_runs(monkeypatch, tmp_path):
    for place in ("mine", "other"):
        (tmp_path / place).mkdir()
        (tmp_path / place / "pip").touch(0o755)
    monkeypatch.setattr(sys, "executable", str(tmp_path / "mine" / "python"))
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("PATH", str(tmp_path / "mine"))
    assert install("gym") == "pip install 'bns-testbed[gym]'"
    monkeypatch.setenv("PATH", str(tmp_path / "other"))
    assert install("gym") == "mine/python -m pip install 'bns-testbed[gym]'"
    monkeypatch.chdir(tmp_path / "other")
    assert install("gym").startswith(f"{tmp_path / 'mine' / 'python'} -m pip ")


def test_no_value_is_not_offered_as_one(said, capsys):
    text = said("effects", "--stage", "foo", code=WRONG_INPUT)
    assert "Available: actuator, body," in text
    with pytest.raises(SystemExit):
        main(["effects", "--help"])
    assert "{command,actuator," in capsys.readouterr().out


def test_a_report_replaces_reports_alone_unless_forced(capsys, run, tmp_path):
    page = tmp_path / "page.html"
    page.write_text("<title>mine</title>")
    asked = ["report", str(run), "--out", str(page)]
    assert main(asked) == WRONG_INPUT
    assert "was not made by `bns report`: add --force" in capsys.readouterr().err
    assert page.read_text() == "<title>mine</title>"
    assert main([*asked, "--force"]) == 0
    made = page.read_bytes()
    assert b"BNS report</title>" in made
    assert main(asked) == 0  # its own it replaces
    (tmp_path / "directory").mkdir()
    assert main(["report", str(run), "--out", str(tmp_path / "directory")]) == (
        WRONG_INPUT
    )


def test_run_to_the_end_and_once_more(said, tmp_path):
    out = tmp_path / "out"
    quiet = ["--rerun", "off", "--no-report"]
    text = said("run", "demo", "--out", out, *quiet, *TINY)
    assert f"data:      {out}" in text
    assert "3 trials of 2 runs" in text and "was not met" in text
    assert load(out).config.preset == "demo"
    again = said("run", "demo", "--out", out, *quiet, *TINY, code=WRONG_INPUT)
    assert "holds a run already: add --resume" in again
    assert "3 trials of 2 runs" in said("run", out, "--resume", *quiet)
    other = said("run", out, "--resume", "--seed", "5", *quiet, code=WRONG_INPUT)
    assert "seed = 0, not 5" in other


def test_compare_prints_tables_and_json(said, fakes, run, tmp_path):
    fakes.train(tmp_path / "other", config=fakes.longer(5))
    text = said("compare", run, tmp_path / "other")
    assert "p (Holm)" in text and "A12" in text and "recover" in text
    found = json.loads(said("compare", run, tmp_path / "other", "--json"))
    assert {pair["measure"] for pair in found["pairs"]} == {
        "observation", "solve", "recover",
    }  # fmt: skip


def test_interrupted_run_says_how_to_go_on(said, fakes, tmp_path, monkeypatch):
    out = tmp_path / "run"
    begun = fakes.train(out, stop=lambda: True)

    def interrupted(config, out, *, stop, **_):
        os.kill(os.getpid(), signal.SIGINT)
        assert stop()
        return begun

    monkeypatch.setattr("bns.experiment.run.train", interrupted)
    text = said("run", "demo", "--out", out, code=STOPPED)
    assert f"bns run {out} --resume" in text


def test_second_interrupt_stops_at_once(monkeypatch):
    def twice():
        with until_interrupted() as stop:
            os.kill(os.getpid(), signal.SIGINT)
            assert stop()
            os.kill(os.getpid(), signal.SIGINT)

    with pytest.raises(KeyboardInterrupt):
        twice()
    monkeypatch.setitem(VERBS, "presets", ("nothing", ""))
    monkeypatch.setattr("bns.__main__.dispatch", lambda argv: twice())
    assert main(["presets"]) == INTERRUPTED


def test_doctor_looks_at_everything(said):
    rows = json.loads(said("doctor", "--json"))
    looked_at = {row["what"] for row in rows}
    assert {"mujoco", "Vulkan", "C++ compiler", "cores", "serial ports"} <= looked_at
    assert all(row["what to do"] for row in rows if row["state"] in ("bad", "missing"))
    assert "Ready to run." in said("doctor")


@pytest.mark.parametrize(
    ("installed", "bad"),
    [
        ({"mujoco": "3.17.0", "dm-control": "1.0.50"}, []),
        ({"mujoco": "4.0.0"}, ["mujoco pin"]),
        ({"mujoco": "4.0.1", "dm-control": "1.0.50"}, ["dm-control pin"]),
        (
            {"mujoco": "4.0.0", "dm-control": "1.0.50"},
            ["mujoco pin", "dm-control pin"],
        ),
    ],
)
def test_known_bad_pins(installed, bad):
    found = pins(lambda name: installed.get(name, ""))
    assert [finding.what for finding in found if finding.state == "bad"] == bad


def test_progress_without_a_terminal_is_a_line_now_and_then(capsys, fakes, monkeypatch):
    monkeypatch.setattr("bns.progress.QUIET_SECONDS", 0.0)
    fakes.train(None, progress=True)
    lines = capsys.readouterr().err.splitlines()
    assert len(lines) == 4
    assert lines[0].startswith("fake: trial 1 of 4, about ") and " s left" in lines[0]
    assert lines[3].endswith(", damaged")


@pytest.mark.parametrize(
    ("values", "told"),
    [
        ([np.inf, np.inf], "Solved by 0 of 2."),
        (
            [3, np.inf, np.inf],
            "Solved by 1 of 3. Half of the runs or more did not, "
            "so there is no median.",
        ),
        ([3, 4], "Solved by 2 of 2, at trial 3.5 in the median."),
        (
            [2, 3, 4, 5, 6, np.inf],
            "Solved by 5 of 6, at trial 4.5 in the median (95 % interval 2 to never).",
        ),
    ],
)
def test_what_happened_is_told_in_words(values, told):
    assert sentence("Solved", np.array(values, dtype=float), "at trial {}") == told


@pytest.mark.parametrize(
    ("interval", "told"),
    [
        ((np.inf, np.inf, np.inf), "never"),
        ((3, 2, np.inf), "2 to never"),
        ((3, -np.inf, np.inf), "too few runs"),
    ],
)
def test_intervals_are_told_in_words(interval, told):
    assert span(interval) == told
