"""Legs that no longer bear, against robots whose lost legs are known."""

from types import SimpleNamespace

import numpy as np
import pytest
import torch

from bns.learners.bns import bearing, nominal
from bns.learners.bns.bearing import ACCOUNTS, judged
from bns.learners.bns.walking import GOAL, MOVED, goal_inputs
from bns.models.phantomx import kinematics

SIZE, BEFORE = 11, 8  # commands of a trial; trials of a sound robot
REST = 0.4  # share of the motion's deviation that no model tells


@pytest.fixture(scope="module")
def walks():
    """Goals of 14 random trials, scaled, and what each account says of them."""
    rng = np.random.default_rng(3)
    goals = rng.uniform(-0.6, 0.6, (14, SIZE, 18))
    inputs = goal_inputs(torch.from_numpy(goals)).numpy().reshape(-1, 36)
    inputs = inputs.astype(np.float32)
    return inputs, bearing.told(inputs, kinematics.contacts)


def moved(walks, lost, change=BEFORE, seed=0):
    """Targets of a robot that moves as its model and noise have it."""
    _, told = walks
    rng = np.random.default_rng(seed)
    now = ACCOUNTS.index(frozenset(lost))
    mine = told[:, 0].copy()
    mine[change * SIZE :] = told[change * SIZE :, now]
    return mine * bearing.SHARES + rng.normal(0, REST * mine.std(0), mine.shape)


def asked(walks, targets, trials, lost=nominal.NONE):
    inputs, told = walks
    some = slice(0, trials * SIZE)
    return judged(inputs[some], targets[some], told[some], SIZE, lost)


@pytest.mark.parametrize("lost", [(0,), (4,), (0, 1), (4, 5), (0, 2, 4)])
def test_lost_legs_are_named_two_trials_after_the_change(walks, lost):
    found = asked(walks, moved(walks, lost), BEFORE + 2)
    assert found == (frozenset(lost), 2 * SIZE)


def test_a_sound_robot_has_lost_none_and_has_not_changed(walks):
    for seed in range(5):
        targets = moved(walks, (), seed=seed)
        for trials in range(1, 15):
            assert asked(walks, targets, trials) == (nominal.NONE, 0)


def test_one_trial_that_is_odd_is_no_change(walks):
    targets = moved(walks, ())
    targets[BEFORE * SIZE : (BEFORE + 1) * SIZE] *= -1
    assert asked(walks, targets, BEFORE + 2) == (nominal.NONE, 0)


def test_a_robot_that_began_without_a_leg_is_told_without_a_change(walks):
    assert asked(walks, moved(walks, (3,), change=0), 5) == (frozenset({3}), 0)


def test_legs_that_bear_again_are_named(walks):
    _, told = walks
    gone = frozenset({4})
    targets = told[:, ACCOUNTS.index(gone)].copy()
    targets[BEFORE * SIZE :] = told[BEFORE * SIZE :, 0]
    assert asked(walks, targets, BEFORE + 3, gone) == (nominal.NONE, 3 * SIZE)


def test_what_is_kept_of_a_pattern_is_what_the_model_says():
    rng = np.random.default_rng(1)
    model = SimpleNamespace(robot="phantomx", lost=[nominal.NONE] * 2)
    kept = bearing.Bearing(model)
    inputs = rng.uniform(-1, 1, (6, 36)).astype(np.float32)
    first = kept.told(1, inputs[:4])
    both = kept.told(1, inputs[2:])
    np.testing.assert_array_equal(both[:2], first[2:])
    goals = inputs[2:].astype(float) * GOAL
    model = nominal.moved(goals[:, :18], goals[:, 18:], kinematics.contacts, ACCOUNTS)
    np.testing.assert_allclose(both * np.array(MOVED), model.transpose(1, 0, 2))
