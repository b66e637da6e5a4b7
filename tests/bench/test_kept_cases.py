"""Cases of a gap bench: made once, on this machine or on another one."""

import json

import pytest

from bench.gap import kept_cases
from bench.gap.kept_cases import Cases


@pytest.fixture
def cases(tmp_path, monkeypatch):
    monkeypatch.setattr(kept_cases, "DIRECTORY", tmp_path / "runs")
    monkeypatch.setattr(kept_cases, "ROUNDS", tmp_path / "rounds")
    monkeypatch.setattr(kept_cases, "commit", lambda: "abc-dirty")
    (tmp_path / "rounds").mkdir()
    return Cases("round", {"single": 2, "none": 1}, first=10, span=5)


def one(kind, seed):
    return {"kind": kind, "seed": seed, "seconds": 2.0}


def test_what_another_machine_made_is_not_made_again(cases):
    kind, seed = cases.wanted()[0]
    row = {"kind": kind, "seed": seed, "seconds": 1.5, "commit": "123"}
    (kept_cases.ROUNDS / "round_0.jsonl").write_text(json.dumps(row) + "\n")
    found = cases.produce(one, cases.wanted())
    assert found[0] == row
    assert [r["commit"] for r in found] == ["123", "abc+", "abc+"]
    assert kept_cases.made(found) == {"commits": ("123", "abc+"), "seconds": 5.5}
    assert cases.produce(lambda *_: pytest.fail("made again"), cases.wanted()) == found


def test_rows_of_before_say_nothing_of_their_commit(cases):
    assert kept_cases.made([{"seconds": 3.0}]) == {}
