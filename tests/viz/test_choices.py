"""Which replicate and trials are shown."""

from dataclasses import replace

import numpy as np
import pytest

from bns.errors import OutOfBoundsError
from bns.viz.choices import choose, typical


def with_solved(record, rows, onset):
    """The record with other outcomes."""
    solved = np.array(rows, dtype=float)
    fitness = np.where(solved > 0, 300.0, 50000.0 - np.arange(solved.shape[1]))
    columns = {
        name: values[: len(rows), : solved.shape[1]]
        for name, values in record.columns.items()
    }
    return replace(
        record,
        columns=columns | {"solved": solved, "fitness": fitness},
        sent=record.sent[: len(rows), : solved.shape[1]],
        poses=record.poses[: len(rows), : solved.shape[1]],
        predicted=record.predicted[: len(rows), : solved.shape[1]],
        damage_onset=np.full(len(rows), onset),
    )


def test_before_at_and_after_the_damage(record):
    made = with_solved(record, [[0, 1, 1, 0, 0, 0, 1, 1]], onset=4)
    assert [choice.trial for choice in choose(made, 0)] == [2, 4, 6]
    assert [choice.label for choice in choose(made, 0)][2] == "recovered"


def test_a_run_that_never_solves_says_so(record):
    made = with_solved(record, [[0, 0, 0, 0, 0, 0]], onset=3)
    found = choose(made, 0)
    assert [choice.trial for choice in found] == [2, 3, 5]  # lowest fitness
    assert "unsolved" in found[0].label and "unsolved" in found[2].label


def test_without_damage_first_solved_and_last(record):
    made = with_solved(record, [[0, 0, 1, 0, 1]], onset=-1)
    assert [choice.trial for choice in choose(made, 0)] == [0, 2, 4]


def test_trials_that_coincide_are_shown_once(record):
    made = with_solved(record, [[1]], onset=-1)
    assert [choice.trial for choice in choose(made, 0)] == [0]


def test_typical_is_the_median_of_those_that_recovered(record):
    rows = [[0, 1, 0, 0, 0, 1], [0, 1, 0, 1, 1, 1], [0, 1, 0, 0, 1, 1], [0] * 6]
    assert typical(with_solved(record, rows, onset=2)) == 2


def test_unknown_replicate(record):
    with pytest.raises(OutOfBoundsError, match="replicate = 99"):
        choose(record, 99)
