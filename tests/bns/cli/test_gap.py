"""`bns gap` and `bns gap bench`, driven with right and wrong input."""

import json
from pathlib import Path
from types import SimpleNamespace

import numpy as np
import pytest

from bns.__main__ import WRONG_INPUT, main
from bns.cli.gap.diagnose import shared
from bns.gap import request
from bns.storage.lock import Lock
from bns.worlds import registry
from bns.worlds.data import dataset
from bns.worlds.trial import Commands
from tests.sources import ROOT


@pytest.fixture
def recording(tmp_path):
    """Three short drives of an undamaged robot as a dataset."""
    world = registry.make("mujoco", robot="khepera3", threads=1)
    commands = [Commands(np.full((2, 2), 0.1), [0.4, 0.3 + 0.1 * i]) for i in range(3)]
    path = tmp_path / "drives"
    dataset.write(path, world.run(commands), provenance={"made by": "test"})
    return path


def test_check_says_how_many_trials_can_be_used(recording, capsys):
    assert main(["gap", "check", str(recording)]) == 0
    assert "3 trials can be used" in capsys.readouterr().out


def test_check_says_that_there_are_too_few(tmp_path, capsys):
    world = registry.make("mujoco", robot="khepera3", threads=1)
    made = world.run([Commands(np.full((2, 2), 0.1), [0.4, 0.4])])
    dataset.write(tmp_path / "drive", made, provenance={"made by": "test"})
    assert main(["gap", "check", str(tmp_path / "drive")]) == 0
    assert "a diagnosis needs 2 at least" in capsys.readouterr().out


@pytest.mark.parametrize(
    ("words", "said"),
    [
        (["gap", "chek", "x"], "Did you mean 'check'"),
        (["gap", "check", "nowhere"], "There is no nowhere: give a dataset"),
        (["gap", "check", "."], "or of a run to be finished"),
        (["gap", "check", ".", "--importer", "mrclam6"], "no RobotN_Odometry.dat"),
        (["gap", "check", ".", "--trials", "5-2"], "'5-2' is backwards; write 2-5"),
        (["gap", "diagnose", ".", "--seed", "-1"], "--seed = -1 is not allowed"),
        (["gap", "diagnose", ".", "--threads", "0"], "give a number from 1 to 1024"),
        (["gap", "edit", "x", "--remove", "a"], "Missing: --predict."),
        (["gap", "diagnose", "x", "--model", "khepera4"], "khepera"),
        (["gap", "check", "x", "--model", "robot.xml"], "a TOML file does: `bns gap"),
        (
            ["gap", "check", "x", "--model", "no.toml"],
            "There is no description no.toml",
        ),
        (["gap", "check", "x", "--importer", "xl33"], "Did you mean 'xl330'"),
        (["gap", "plan", "nowhere"], "bns gap diagnose DATA --out nowhere"),
        (["gap", "edit", "nowhere", "--remove", "a", "--predict", "b"], "nowhere"),
        (["gap", "apply", "nowhere", "--world", "kitchen"], "nowhere"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(words, said, capsys):
    assert main(words) == 2
    error = capsys.readouterr().err
    assert said in error
    assert error.count("\n") == 1


def test_an_existing_output_is_not_overwritten(recording, tmp_path, capsys):
    words = ["gap", "diagnose", str(recording), "--out", str(tmp_path)]
    assert main(words) == 2
    assert "not overwritten" in capsys.readouterr().err


def test_results_go_to_the_first_free_directory_of_the_recording(
    recording, tmp_path, capsys, monkeypatch
):
    monkeypatch.chdir(tmp_path)
    words = ["gap", "diagnose", str(recording), "--no-report", "--no-rerun"]
    for name in ("drives", "drives-2"):
        assert main(words) == 0
        assert f"runs/gap/{name}/diagnosis.json" in capsys.readouterr().out
    assert main([*words, "--out", "none"]) == 0
    assert len(list((tmp_path / "runs" / "gap").iterdir())) == 2


def test_an_unfinished_diagnosis_is_gone_on_with_by_the_same_command(tmp_path):
    named, asked = tmp_path / "drives", {"seed": 0}
    assert request.place(named, asked) == named
    named.mkdir()
    request.begin(named, asked)
    assert request.place(named, asked) == named
    assert request.place(named, {"seed": 1}) == tmp_path / "drives-2"
    (tmp_path / "drives-2").write_text("a file")
    assert request.place(named, {"seed": 1}) == tmp_path / "drives-3"
    stopped = tmp_path / "drives-3"
    stopped.mkdir()
    (stopped / request.PARTIAL).write_text("{}")  # what a check found: no result
    assert request.place(named, {"seed": 1}) == stopped


def test_help_without_a_verb(capsys):
    with pytest.raises(SystemExit, match="0"):
        main(["gap"])
    assert "diagnose" in capsys.readouterr().out


ARM = str(ROOT / "examples" / "arm" / "arm.toml")


@pytest.fixture(scope="module")
def made(tmp_path_factory):
    """A case of a stranger's robot without and with something outside the library."""
    home = tmp_path_factory.mktemp("bench")
    words = [str(home / "cases"), "--answers", str(home / "answers.json")]
    kinds = ["--kinds", "none", "off-library", "--count", "1", "--model", ARM]
    assert main(["gap", "bench", "make", *words, *kinds]) == 0
    return home


def test_cases_hold_no_answers(made):
    names = sorted(path.name for path in (made / "cases").iterdir())
    assert names == ["case_000000", "case_001000"]
    for name in names:
        data = dataset.read(made / "cases" / name)
        assert data.robot == "arm" and len(data) == 6
        assert not any(trial.conditions for trial in data.trials)
    known = json.loads((made / "answers.json").read_text())["cases"]
    assert known["case_000000"]["kind"] == "none"
    (hidden,) = known["case_001000"]["effects"]
    listed = Path(ARM).read_text().partition("[effects]")[2]
    assert hidden.partition(":")[0] not in listed


def test_one_process_at_a_time_writes_what_is_said(made, tmp_path, capsys):
    asked = [str(made / "cases"), "--said", str(tmp_path / "said.jsonl")]
    with Lock(tmp_path):
        assert main(["gap", "bench", "run", *asked, "--model", ARM]) == WRONG_INPUT
    assert "is being written by another process" in capsys.readouterr().err
    assert not (tmp_path / "said.jsonl").exists()
    again = ["--answers", str(tmp_path / "a.json"), "--count", "1", "--model", ARM]
    with Lock(made / "cases"):
        words = ["gap", "bench", "make", str(made / "cases"), *again]
        assert main(words) == WRONG_INPUT
    assert not (tmp_path / "a.json").exists()


def test_effects_are_hidden_in_a_robot_of_ones_own(tmp_path):
    words = [str(tmp_path / "cases"), "--answers", str(tmp_path / "answers.json")]
    kinds = ["--kinds", "single", "pair", "--count", "1", "--model", ARM]
    assert main(["gap", "bench", "make", *words, *kinds]) == 0
    known = json.loads((tmp_path / "answers.json").read_text())["cases"]
    for answer, count in zip(known.values(), (1, 2), strict=True):
        assert len(answer["names"]) == len(answer["sizes"]) == count
        named = zip(answer["names"], answer["aliases"], strict=True)
        assert all(name in accepted for name, accepted in named)


def said(kind, named=()):
    """What a diagnosis says, as much of it as scores read."""
    verdict = {"kind": kind, "named": named, "sets": named or [[]]}
    verdict |= {"p_gap": 0.0, "p_misfit": 0.0}
    return {"verdict": verdict, "signatures": {}, "closed": {}, "seconds": {"all": 1.0}}


def test_scores_are_of_what_was_said(made, capsys):
    lines = [
        {"name": "case_000000", "diagnosis": said("no gap")},
        {"name": "case_001000", "diagnosis": said("effect", [["command_lag[all]"]])},
    ]
    file = made / "said.jsonl"
    file.write_text("".join(json.dumps(line) + "\n" for line in lines))
    assert main(["gap", "bench", "score", str(file), str(made / "answers.json")]) == 0
    out = capsys.readouterr().out
    rows = {
        line.split()[0]: line.split()[-1] for line in out.splitlines() if line.strip()
    }
    assert rows["none"] == "1.00"
    assert rows["off-library"] == "0.00"
    assert "off-library -> command_lag[all]" in out


@pytest.mark.parametrize(
    ("words", "wanted"),
    [
        (["make", "c", "--answers", "c/a.json"], "see the answers"),
        (["make", "c", "--answers", "a", "--kinds", "sngle"], "Did you mean 'single'"),
        (["make", "c", "--answers", "."], "is there and is no file"),
        (["make", "c", "--answers", "a", "--count", "0"], "--count = 0 is not allowed"),
        (["make", __file__, "--answers", "a"], "give a directory for the cases"),
        (["run", "nowhere", "--said", "s"], "no directory nowhere"),
        (["score", "nowhere", "nothing"], "nothing cannot be read"),
        (["scor"], "Did you mean 'score'"),
    ],
)
def test_wrong_input_of_the_bench_is_one_line_and_exit_code_2(words, wanted, capsys):
    assert main(["gap", "bench", *words]) == 2
    error = capsys.readouterr().err
    assert wanted in error and error.count("\n") == 1


def test_a_directory_without_cases_is_not_diagnosed(tmp_path, capsys):
    (tmp_path / "cases").mkdir()
    words = ["gap", "bench", "run", str(tmp_path / "cases")]
    assert main([*words, "--said", str(tmp_path / "said.jsonl")]) == 2
    assert "holds no cases: make some with" in capsys.readouterr().err


def test_settings_that_recordings_share_are_kept_for_plans():
    told = {"gain": 8.0, "servo": "xl330", "trajectory": "sweep", "mass": 0.5}
    trials = [SimpleNamespace(conditions=told | {"mass": mass}) for mass in (0.5, 0.7)]
    assert shared(trials) == {"gain": 8.0, "servo": "xl330"}
