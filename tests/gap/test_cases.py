"""Cases of the withheld-effect bench, and how they are scored."""

from dataclasses import asdict

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap.bench import benchmark_io, cases, scoring
from bns.gap.bench.wheeled_cases import WheeledStand
from bns.gap.models.wheeled.model import WheeledModel
from bns.gap.recordings import check


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
    first = cases.build(5, "none", WheeledStand(model))
    second = cases.build(5, "none", WheeledStand(model))
    np.testing.assert_equal(asdict(first.answer), asdict(second.answer))  # nan too
    for a, b in zip(first.trials, second.trials, strict=True):
        assert np.array_equal(a.observed, b.observed, equal_nan=True)
    assert not first.trials[0].conditions, "the recording gives the answer away"


@pytest.mark.parametrize("seed", range(4))
def test_faults_are_noticed(model, seed):
    case = cases.build(seed, "fault", WheeledStand(model))
    _, notes = check.check(case.trials, model)
    words = {
        "wrap": "wrapped",
        "spikes": "spike",
        "duplicate": "the same samples",
        "stuck": "stuck",
        "lost": "samples",
        "infinite": "infinite",
        "clock": "clocks disagree",
    }
    assert words[case.answer.fault] in " ".join(notes)


def test_a_casebook_keeps_its_answers_apart(model, tmp_path):
    case = cases.build(5, "none", WheeledStand(model))
    with pytest.raises(BnsError, match="see the answers"):
        benchmark_io.make(tmp_path / "book", tmp_path / "book" / "a.json", [])
    made = benchmark_io.make(
        tmp_path / "book", tmp_path / "kept" / "answers.json", [("c1", case)]
    )
    assert made == 1
    assert "wheel_diameter" not in (tmp_path / "book/c1/dataset.json").read_text()
    said = tmp_path / "said.jsonl"
    few = FewRows(threads=1)
    assert benchmark_io.run(tmp_path / "book", few, said) == 1
    assert benchmark_io.run(tmp_path / "book", few, said) == 0
    (row,) = benchmark_io.score(said, tmp_path / "kept" / "answers.json")
    assert row["kind"] == "none"
    assert row["said"]["verdict"] == "no gap"


class FewRows(WheeledModel):
    def rows(self, trials):
        return tuple(row for row in super().rows(trials) if row.slack or row.nuisance)


def test_a_case_hides_what_its_answer_says(model):
    case = cases.build(3, "single", WheeledStand(model), wanted="wheel_gain[left]")
    (name,), (text,) = case.answer.names, case.answer.effects
    assert name == "wheel_gain[left]" and text.startswith("wheel_gain:wheel=left")
    assert name in case.answer.aliases[0]
    low, high = cases.SIZES
    assert 0.5 * low < case.answer.sizes[0] < 2 * high


def test_an_interval_holds_the_truth_or_does_not():
    kept = row([["a"]])
    kept["answer"] |= {"magnitudes": [2.2], "effects": ["a:factor=2.2"]}
    kept["said"]["intervals"] = [[2.0, 1.9, 2.1]]
    assert scoring.parameter([kept])["intervals that hold"] == 0
    assert scoring.parameter([kept])["median relative error"] == pytest.approx(1 / 6)
    kept["said"]["intervals"] = [[2.0, 1.7, 2.3]]
    assert scoring.parameter([kept])["intervals that hold"] == 1
