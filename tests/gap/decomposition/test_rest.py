"""What recurs in repeats is model error, what does not is scatter."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import rest

PAIRS, LENGTH, STEP = 3, 60, 0.1  # of repeats; windows of a trial, and seconds apart


def recorded(commands=PAIRS):
    """Trials that are told so many commands in turn."""
    told = [
        SimpleNamespace(values=np.full((1, 1), n % commands), durations=np.array([6.0]))
        for n in range(2 * PAIRS)
    ]
    times = 0.5 + STEP * np.arange(LENGTH)
    return SimpleNamespace(
        trials=[SimpleNamespace(commands=commands) for commands in told],
        windows=[SimpleNamespace(times=times)] * len(told),
        trial=np.repeat(np.arange(len(told)), LENGTH),
    )


def scatter(rng, kind):
    """What a robot scatters by in each of two features, ``(N, 2)``."""
    made = rng.standard_normal((2 * PAIRS, LENGTH, 2))
    if kind == "walk":
        made = np.cumsum(made, axis=1)
    return made.reshape(-1, 2)


@pytest.mark.parametrize("commands", [1, PAIRS])
@pytest.mark.parametrize("kind", ["noise", "walk"])
def test_scatter_does_not_recur(kind, commands):
    rng = np.random.default_rng(3)
    problem = recorded(commands)
    found = [rest.repeated(problem, scatter(rng, kind)) for _ in range(200)]
    assert np.mean(np.array(found) > rest.SURE) <= 0.01


def test_an_error_of_one_feature_recurs_though_the_robot_goes_astray():
    rng = np.random.default_rng(4)
    swing = 4 * np.sin(np.outer(np.arange(1, PAIRS + 1), 0.3 * np.arange(LENGTH)))
    error = np.stack([np.tile(swing.ravel(), 2), np.zeros(2 * PAIRS * LENGTH)], axis=1)
    found = [rest.repeated(recorded(), scatter(rng, "walk") + error) for _ in range(20)]
    assert min(found) > rest.SURE


def test_one_wild_value_does_not_recur():
    errors = scatter(np.random.default_rng(5), "noise")
    errors[10] = 1e3
    assert rest.repeated(recorded(), errors) < rest.SURE


def test_without_repeats_nothing_recurs():
    problem = recorded()
    for number, trial in enumerate(problem.trials):
        trial.commands.values = np.full((1, 1), number)
    assert rest.repeated(problem, scatter(np.random.default_rng(6), "walk")) == 0.0
