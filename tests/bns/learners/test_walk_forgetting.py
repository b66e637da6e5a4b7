"""Forgetting by evidence: a change of the robot is seen, nothing else is."""

from dataclasses import replace

import numpy as np
import pytest

from bns.experiment.config_watch import WatchConfig
from bns.experiment.run import train
from bns.learners.bns import change_evidence as forgetting
from bns.learners.bns.memory import PatternBuffer
from tests.bns.walkers import Slider, small

SIZE = 11


def walks(trials, *, change=None, seed=0, noise=0.2):
    """Patterns of walks that wander, on which half of the robot's law turns round."""
    rng = np.random.default_rng(seed)
    law = rng.normal(size=(36, 3)) / 2
    gait = rng.normal(size=(SIZE, 36))
    seen = np.array(
        [gait := gait + rng.normal(0, 0.1, gait.shape) for _ in range(trials)]
    )
    told = np.tanh(seen @ law) * 2
    if change is not None:
        law[:18] *= -1
        told[change:] = np.tanh(seen[change:] @ law) * 2
    told += rng.normal(0, noise, told.shape)
    return seen.reshape(-1, 36), told.reshape(-1, 3)


@pytest.mark.parametrize("seed", range(4))
def test_the_trials_since_a_change_are_found_to_the_trial(seed):
    seen, told = walks(20, change=17, seed=seed)
    assert forgetting.changed(seen, told, SIZE) == 3 * SIZE


@pytest.mark.parametrize("seed", range(4))
def test_noise_and_wandering_are_no_change(seed):
    seen, told = walks(27, seed=seed, noise=0.6)
    assert forgetting.changed(seen, told, SIZE) == 0


def test_ground_that_was_never_walked_is_no_change():
    seen, told = walks(20)
    seen[-3 * SIZE :] += 5.0  # far from everything
    told[-3 * SIZE :] *= -1.0
    assert forgetting.changed(seen, told, SIZE) == 0


@pytest.mark.parametrize("back", [1, 2, 3])
def test_one_odd_trial_is_no_change_however_odd(back):
    seen, told = walks(20)
    odd = slice(len(told) - back * SIZE, len(told) - (back - 1) * SIZE)
    told[odd] = -20.0
    assert forgetting.changed(seen, told, SIZE) == 0


def test_few_old_trials_are_no_ground_to_judge_from():
    least = forgetting.OLD + min(forgetting.NEW)
    seen, told = walks(least, change=forgetting.OLD)
    assert forgetting.changed(seen, told, SIZE) == 2 * SIZE
    assert forgetting.changed(seen[SIZE:], told[SIZE:], SIZE) == 0


def test_the_probability_is_that_of_the_normal_distribution():
    from scipy.stats import multivariate_normal

    seen, told = walks(2)
    like, scale = forgetting.covariance(seen), np.array([1.0, 4.0, 9.0])
    wanted = sum(
        multivariate_normal.logpdf(told[:, axis], cov=like * scale[axis])
        for axis in range(3)
    )
    constant = 3 * len(told) * np.log(2 * np.pi) / 2  # the same under both accounts
    found = forgetting.foretold(like, told, scale).sum()
    assert found - constant == pytest.approx(wanted)


def test_a_buffer_keeps_its_newest():
    buffer = PatternBuffer(2, [0, 0], (1, 1))
    for run in range(2):
        buffer.append(run, np.arange(5.0)[:, None], np.arange(5.0)[:, None])
    buffer.keep(0, 2)
    buffer.keep(1, 9)
    assert buffer.inputs[0].ravel().tolist() == buffer.targets[0].ravel().tolist()
    assert buffer.inputs[0].ravel().tolist() == [3.0, 4.0]
    assert buffer.counts.tolist() == [2, 5]


class Turned(Slider):
    """From trial 14 on the same commands move the body the other way."""

    def run(self, commands, *, trial=0, seeds=()):
        trials = super().run(commands, trial=trial, seeds=seeds)
        way = -1 if trial >= 14 else 1
        return [replace(t, observed=t.observed * [way, 1, 1]) for t in trials]


def test_a_learner_drops_what_came_before_the_change():
    quiet = replace(small().world, damage=())
    config = small(trials=17, watch=WatchConfig(forget=True), world=quiet)
    record = train(config, world=Turned())
    counts = record["patterns"].astype(int)
    assert (counts[:, :14] == SIZE * np.arange(1, 15)).all(), "no false alarm"
    assert (counts[:, 16] == 3 * SIZE).all(), counts
    usual = train(replace(config, watch=WatchConfig()), world=Turned())
    assert (usual["patterns"][:, 16] == 17 * SIZE).all()
