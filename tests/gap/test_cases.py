"""Cases of the withheld-effect bench, and how they are scored."""

from dataclasses import asdict, replace

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap.bench import benchmark_io, cases, scoring
from bns.gap.core import model_order, verdict
from bns.gap.models.wheeled import WheeledModel
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
    first = cases.build(5, "none", model)
    second = cases.build(5, "none", model)
    np.testing.assert_equal(asdict(first.answer), asdict(second.answer))  # nan too
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
        benchmark_io.make(tmp_path / "book", tmp_path / "book" / "a.json", [])
    made = benchmark_io.make(
        tmp_path / "book", tmp_path / "answers.json", [("c1", case)]
    )
    assert made == 1
    assert "wheel_diameter" not in (tmp_path / "book/c1/dataset.json").read_text()
    said = tmp_path / "said.jsonl"
    few = FewCandidates(threads=1)
    assert benchmark_io.run(tmp_path / "book", few, said) == 1
    assert benchmark_io.run(tmp_path / "book", few, said) == 0
    (row,) = benchmark_io.score(said, tmp_path / "answers.json")
    assert row["kind"] == "none"
    assert row["said"]["verdict"] == "no gap"


class FewCandidates(WheeledModel):
    def candidates(self):
        return tuple(c for c in super().candidates() if c.slack)


def rungs():
    nothing = model_order.Rung(0, 190.0, (95.0, 95.0), (((), 0.0),), 0.0, 80.0, 0.0)
    scores = ((("a",), 0.0), (("b",), 4.0))
    one = model_order.Rung(1, 100.0, (50.0, 51.0), scores, 0.5, 0.0, 90.0)
    two = model_order.Rung(2, 80.0, (41.0, 42.0), ((("a", "c"), 0.0),), 0.5, 0.0, 110.0)
    return [nothing, one, two]


def test_thresholds_are_applied_to_what_was_kept():
    kept = row([["a"]])
    kept["said"] |= {"p_gap": 1e-9, "worth": 13.0, "magnitudes": [[2.0, 0.1, 1.0]]}
    kept["said"]["rungs"] = [rung.as_dict() for rung in rungs()]
    narrow = verdict.Calibration(tie=3.0, sure=3.5, more=25.0, model_error=0.0)
    wide = verdict.Calibration(tie=5.0, sure=5.0, more=25.0, widen=2.0)
    assert scoring.judged(kept, narrow)["said"]["verdict"] == "effect"
    assert scoring.judged(kept, wide)["said"]["verdict"] == "either"
    assert scoring.judged(kept, wide)["said"]["sets"] == (("a",), ("b",))
    kept["answer"]["magnitudes"] = [2.2]
    assert scoring.parameter([scoring.judged(kept, narrow)])["intervals that hold"] == 0
    assert scoring.parameter([scoring.judged(kept, wide)])["intervals that hold"] == 1


def test_a_further_effect_has_to_explain_its_share():
    of = verdict.Calibration
    assert model_order.climb(rungs(), 13.0, of(more=15.0, minor=0.1)).size == 2
    assert model_order.climb(rungs(), 13.0, of(more=25.0, minor=0.1)).size == 1
    assert model_order.climb(rungs(), 13.0, of(more=15.0, minor=0.2)).size == 1
    assert model_order.climb(rungs(), 200.0, of(more=15.0, minor=0.1)).size == 0
    worse = replace(rungs()[2], held_out=(52.0, 53.0))
    assert model_order.climb([*rungs()[:2], worse], 13.0, of(more=15.0)).size == 1
