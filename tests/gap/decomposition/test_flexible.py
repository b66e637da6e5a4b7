"""What a regression that knows no effects says of explanations."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import flexible
from bns.gap.decomposition.rest import Floor

TRIALS, WINDOWS = 10, 40


def recording(*, patterns=True, trials=TRIALS):
    """A problem of robots that drive arcs from any heading, its motion and headings."""
    rng = np.random.default_rng(5)
    spans = np.full(WINDOWS, 0.4)
    turns = rng.uniform(-0.3, 0.3, trials)
    starts = rng.uniform(-3, 3, trials)
    yaw = starts[:, None] + turns[:, None] * np.arange(WINDOWS)
    speed = np.repeat(rng.uniform(0.02, 0.08, trials), WINDOWS)
    motion = np.stack([speed, 0 * speed, np.repeat(turns, WINDOWS)], axis=1)
    waves = np.stack([np.cos(yaw), np.sin(yaw)], axis=2)
    known = {"the heading": waves} if patterns else {}
    model = SimpleNamespace(
        patterns=lambda trial, windows: {n: v[trial] for n, v in known.items()}
    )
    problem = SimpleNamespace(
        model=model,
        trials=tuple(range(trials)),
        windows=tuple(SimpleNamespace(durations=spans) for _ in range(trials)),
        trial=np.repeat(np.arange(trials), WINDOWS),
        recorded=motion,
    )
    noise = rng.normal(0, (1e-3, 1e-3, 5e-3), motion.shape)
    return problem, motion, yaw.ravel(), noise


def said(gap, rest, **about):
    problem, *_ = recording(**about)
    problem.recorded = problem.recorded + gap
    sd = np.broadcast_to([1e-3, 1e-3, 5e-3], gap.shape)
    inside = np.ones(gap.shape, dtype=bool)
    return flexible.imitated(problem, gap, rest, Floor(sd[0], sd), inside)


def slipping(**about):
    """A wheel that slips by the heading, and what is left of it by something that is
    as large in the mean of each trial."""
    problem, motion, yaw, noise = recording(**about)
    gap = noise.copy()
    gap[:, 2] += 2.0 * motion[:, 0] * np.cos(yaw)
    mean = np.bincount(problem.trial, gap[:, 2]) / WINDOWS
    rest = gap.copy()
    rest[:, 2] -= mean[problem.trial]
    return gap, rest, noise


def test_what_goes_with_the_heading_is_no_change_by_trials():
    gap, rest, _ = slipping()
    assert said(gap, rest) == "the heading"


@pytest.mark.parametrize(("mean", "says"), [(1.0, "the heading"), (10.0, "")])
def test_the_mean_of_what_goes_with_the_heading_is_no_explanation(mean, says):
    _, motion, yaw, noise = recording()
    gap, rest = noise.copy(), noise.copy()
    gap[:, 2] += 2.0 * motion[:, 0] * (mean + np.cos(yaw))
    rest[:, 2] += 2.0 * motion[:, 0] * np.cos(yaw)
    assert said(gap, rest) == says


def test_an_explanation_that_is_right_stands():
    gap, _, noise = slipping()
    assert said(gap, noise) == ""


def test_what_leaves_little_stands():
    gap, rest, noise = slipping()
    assert said(gap, noise + 0.02 * (rest - noise)) == ""


@pytest.mark.parametrize("about", [{"patterns": False}, {"trials": 3}])
def test_nothing_is_said_without_patterns_or_other_trials(about):
    gap, rest, _ = slipping(**about)
    assert said(gap, rest, **about) == ""
