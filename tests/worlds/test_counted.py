"""A model world counts what is executed in it, and ends where its budget does."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.worlds import registry
from bns.worlds.trial import Commands
from bns.worlds.world import BudgetSpentError, CountedWorld, World

COMMANDS = [Commands([[0.1, 0.05]], [0.5]), Commands([[0.05, 0.1]], [0.5])]


@pytest.fixture
def inner():
    return registry.make("static-snn", robot="khepera3")


def test_it_is_a_world_and_gives_what_the_world_gives(inner):
    model = CountedWorld(inner, 5)
    assert isinstance(model, World)
    wanted, found = (w.run(COMMANDS, seeds=[1, 2]) for w in (inner, model))
    for one, other in zip(wanted, found, strict=True):
        np.testing.assert_array_equal(one.observed, other.observed)
    assert (model.spent, model.left) == (2, 3)


def test_more_than_what_is_left_is_refused_and_not_charged(inner):
    model = CountedWorld(inner, 3)
    model.run(COMMANDS)
    with pytest.raises(BudgetSpentError, match=r"2 evaluations .* 1 of 3 left"):
        model.run(COMMANDS)
    assert model.left == 1
    model.run(COMMANDS[:1])
    assert model.left == 0


def test_runs_that_share_a_world_count_for_themselves(inner):
    one, other = CountedWorld(inner, 4), CountedWorld(inner, 4)
    one.run(COMMANDS)
    assert (one.spent, other.spent) == (2, 0)


def test_a_world_without_closed_loops_says_so(inner):
    with pytest.raises(BnsError, match="no closed loops"):
        CountedWorld(inner, 4).drive(object())
