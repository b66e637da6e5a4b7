"""Figures: what is drawn is what was recorded."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bns.errors import OutOfBoundsError
from bns.learners.bns.learner import DIVERSITY, SNN_ERROR
from bns.viz import facts, figures, style
from bns.viz.choices import choose, typical
from bns.viz.figures import trials
from bns.viz.figures.motion import SHOWN, groups
from bns.viz.paths import arcs, dashes, listed

OVER_TRIALS = ("fitness", "solved", "waits")
OF_BNS = {item.name: item for item in (SNN_ERROR, DIVERSITY)}


@pytest.fixture(scope="module")
def undamaged(record):
    never = np.full(record.replicates, -1)
    return replace(record, damage_onset=never)


@pytest.mark.parametrize("name", [*OVER_TRIALS, *OF_BNS])
def test_one_run_several_runs_and_no_damage(name, record, undamaged):
    make = getattr(figures, name, None)
    make = make or partial(figures.curves, shown=OF_BNS[name])
    assert make({"a": record}).axes
    labels = [
        text.get_text()
        for axes in make({"a": record, "b": undamaged}).axes
        if axes.get_legend()
        for text in axes.get_legend().get_texts()
    ]
    assert labels == ["a", "b"]
    assert make({"a": undamaged}).axes


@pytest.mark.parametrize("name", ["path", "displacement"])
def test_figures_of_one_run(name, record, undamaged):
    assert len(getattr(figures, name)(record).axes) == 3
    assert getattr(figures, name)(undamaged).axes


def test_fitness_shows_the_median_and_the_onset(record):
    axes = figures.fitness({"a": record}).axes[0]
    lines = {line.get_label(): line for line in axes.lines}
    assert np.allclose(lines["a"].get_ydata(), np.median(record["fitness"], axis=0))
    assert any(np.allclose(line.get_xdata(), 19.5) for line in axes.lines)
    assert axes.get_yscale() == "log"


def test_share_of_runs_that_solve(record):
    right = figures.solved({"a": record}).axes[1]
    share = 100 * record["solved"].mean(axis=0)
    assert np.allclose(right.lines[0].get_ydata(), share)


def test_waits_end_at_the_share_that_made_it(record):
    left, right = figures.waits({"a": record}).axes
    made = np.isfinite(facts.to_solve(record)).mean()
    assert np.isclose(left.lines[0].get_ydata()[-1], 100 * made)
    assert np.isclose(right.lines[0].get_ydata()[-1], 100)


def test_onsets_are_marked_once(record, undamaged):
    assert trials.onsets({"a": record, "b": record, "c": undamaged}) == [20]


def test_displacement_groups_lie_around_the_damage(record):
    before, just, last = groups(record)
    assert list(before.trials) == list(range(10, 20))
    assert list(just.trials) == list(range(20, 25))
    assert list(last.trials) == list(range(30, 40))


def test_displacement_is_thinned_and_stays_in_its_frame(record):
    wild = replace(record, predicted=record.predicted * 1000)
    turn = figures.displacement(wild).axes[2]
    dots = [line for line in turn.lines if line.get_marker() == "o"]
    assert all(len(line.get_xdata()) <= SHOWN for line in dots)
    highest = max(np.abs(line.get_ydata()).max() for line in dots)
    assert highest < 2 * max(np.abs(line.get_xdata()).max() for line in dots)


def test_the_path_fades_after_the_last_objective(record):
    from bns.tasks import registry as tasks

    task = tasks.of(record.config)

    poses = record.poses[0, 39]
    poses = poses[np.isfinite(poses[:, 0])]
    assert record["solved"][0, 39]
    longer = np.concatenate([poses, poses[-1:] + np.ones(3)])
    assert task.finish(longer) == len(poses) - 1
    assert task.finish(poses[:3]) == 2  # not done: all of it


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


def test_a_quarter_circle():
    poses = np.array([[0, 0, 0], [1, 1, np.pi / 2]])
    found = arcs(poses, 4)
    assert np.allclose(np.linalg.norm(found[:, :2] - [0, 1], axis=1), 1)
    assert np.allclose(found[2], [np.sin(np.pi / 4), 1 - np.cos(np.pi / 4), np.pi / 4])


def test_arcs_pass_through_the_poses_they_join():
    poses = np.random.default_rng(0).normal(size=(6, 3))
    assert np.allclose(arcs(poses, 5)[::5], poses)


def test_a_straight_line_and_a_full_turn_stay_finite():
    poses = np.array([[0, 0, 0], [1, 0, 0], [1.01, 0, 2 * np.pi]])
    found = arcs(poses, 8)
    assert np.allclose(found[4], [0.5, 0, 0])
    assert np.abs(found[:, :2]).max() < 1.1


def test_listed_stops_at_the_first_gap():
    poses = np.zeros((5, 3))
    poses[3:] = np.nan
    assert len(listed(poses)) == 3
    assert len(listed(np.zeros((5, 3)))) == 5


def test_dashes_cover_half_the_length():
    pieces = dashes(np.array([[0.0, 0.0], [1.0, 0.0]]), dash=0.05)
    assert np.isclose(sum(np.ptp(piece[:, 0]) for piece in pieces), 0.5, atol=0.05)
    assert dashes(np.zeros((3, 2))) == []


def test_a_long_name_is_broken_after_an_underscore():
    name = "shoulder_lift_joint_position [rad]"
    with style.plotting() as figure_class:
        figure = figure_class(figsize=(4, 1.2), layout="constrained")
        label = figure.subplots().set_ylabel(name)
        style.fit(figure)
    lines = label.get_text().split("\n")
    assert len(lines) > 1 and "".join(lines).replace(" ", "") == name.replace(" ", "")
    assert lines[0].endswith("_")
