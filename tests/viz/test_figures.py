"""Figures: what is drawn is what was recorded."""

from dataclasses import replace
from functools import partial

import numpy as np
import pytest

from bns.learners.bns.learner import DIVERSITY, SNN_ERROR
from bns.viz import facts, figures
from bns.viz.figures import trials
from bns.viz.figures.displacement import SHOWN, groups

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
