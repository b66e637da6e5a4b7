"""`bns gap bench`: cases without their answers, and what was said scored with them."""

import json
from pathlib import Path

import pytest

from bns.__main__ import main
from bns.worlds.data import dataset
from tests.sources import ROOT

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
        (["run", "nowhere", "--said", "s"], "no directory nowhere"),
        (["score", "nowhere", "nothing"], "nothing cannot be read"),
        (["scor"], "Did you mean 'score'"),
    ],
)
def test_wrong_input_is_one_line_and_exit_code_2(words, wanted, capsys):
    assert main(["gap", "bench", *words]) == 2
    error = capsys.readouterr().err
    assert wanted in error and error.count("\n") == 1
