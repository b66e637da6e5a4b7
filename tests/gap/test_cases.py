"""Cases of the withheld-effect bench, and how they are scored."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap import casebook, cases, check, scoring, verdict
from bns.gap.wheeled import WheeledModel


@pytest.fixture(scope="module")
def model():
    return WheeledModel(threads=1)


def row(named, names=("a",), aliases=(("a", "b"),), verdict="effect", sets=None):
    answer = {"names": list(names), "aliases": [list(x) for x in aliases]}
    answer |= {"sizes": [4.0], "effects": list(names)}
    said = {"verdict": verdict, "named": named, "sets": sets or named}
    return {"kind": "single", "seed": 1, "answer": answer, "said": said}


def test_aliases_are_merged_but_counted_strictly_too():
    assert scoring.right(row([["b"]]))
    assert not scoring.strict(row([["b"]]))
    assert scoring.confident_wrong(row([["b"]]))
    assert not scoring.right(row([["c"]]))
    assert scoring.merged(row([["a"], ["b"], ["c"]], verdict="either")) == 2


def test_pairs_match_in_any_order():
    answer = {"aliases": [["a", "b"], ["c"]]}
    assert scoring.matches(["c", "b"], answer)
    assert not scoring.matches(["a", "b"], answer)
    assert not scoring.matches(["a"], answer)


def test_silence_is_not_counted_as_right():
    silent = row([], verdict="no gap", sets=[[]])
    assert not scoring.right(silent)
    assert scoring.by_size([silent])[5]["silent"] == 1.0


def test_a_case_is_the_same_for_the_same_seed(model):
    first = cases.build(5, "none", model)
    second = cases.build(5, "none", model)
    assert first.answer == second.answer
    for a, b in zip(first.trials, second.trials, strict=True):
        assert np.array_equal(a.observed, b.observed, equal_nan=True)
    assert not first.trials[0].conditions, "the recording gives the answer away"


@pytest.mark.parametrize("seed", range(4))
def test_faults_are_noticed(model, seed):
    case = cases.build(seed, "fault", model)
    _, notes = check.check(case.trials, model)
    words = {
        "wrap": "wrapped",
        "spikes": "spikes",
        "duplicate": "the same samples",
        "stuck": "stuck",
        "lost": "samples",
        "infinite": "infinite",
        "clock": "clocks disagree",
    }
    assert words[case.answer.fault] in " ".join(notes)


def test_a_casebook_keeps_its_answers_apart(model, tmp_path):
    case = cases.build(5, "none", model)
    with pytest.raises(BnsError, match="see the answers"):
        casebook.make(tmp_path / "book", tmp_path / "book" / "a.json", [])
    made = casebook.make(tmp_path / "book", tmp_path / "answers.json", [("c1", case)])
    assert made == 1
    assert "wheel_diameter" not in (tmp_path / "book/c1/dataset.json").read_text()
    said = tmp_path / "said.jsonl"
    few = FewCandidates(threads=1)
    assert casebook.run(tmp_path / "book", few, said) == 1
    assert casebook.run(tmp_path / "book", few, said) == 0
    (row,) = casebook.score(said, tmp_path / "answers.json")
    assert row["kind"] == "none"
    assert row["said"]["verdict"] == "no gap"


class FewCandidates(WheeledModel):
    def candidates(self):
        return tuple(c for c in super().candidates() if c.slack)


def test_thresholds_are_applied_to_what_was_kept():
    kept = row([["a"]])
    kept["said"] |= {"size": 1, "p_gap": 1e-9, "p_misfit": 0.5, "excess": 0.0}
    kept["said"] |= {"explained": 90.0}
    kept["said"]["ranked"] = [
        {"names": ["a"], "score": 0.0},
        {"names": ["b"], "score": 4.0},
    ]
    narrow = verdict.Calibration(tie=3.0, sure=3.5)
    wide = verdict.Calibration(tie=5.0, sure=5.0)
    assert scoring.judged(kept, narrow)["said"]["verdict"] == "effect"
    assert scoring.judged(kept, wide)["said"]["verdict"] == "either"
    assert scoring.judged(kept, wide)["said"]["sets"] == (("a",), ("b",))
