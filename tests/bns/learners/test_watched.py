"""Navigation that watches its data, in the exact and cheap world."""

from dataclasses import replace

import numpy as np
import pytest

from bns.experiment.config import AdaptationConfig, SnnConfig, WorldConfig
from bns.experiment.config_watch import WatchConfig
from bns.learners.bns.navigation import WheeledProblem, ways
from bns.snn.scaling import AXLE
from tests.bns.learners.test_learner import SMALL, batch, play

WATCH = WatchConfig(detect=True, forget=True, warmup=4, history=8)


def broken(wheel, onset=10):
    world = WorldConfig(
        name="static-snn", damage=(f"wheel_gain:wheel={wheel},factor=0.3@{onset}",)
    )
    return replace(
        SMALL,
        watch=WATCH,
        world=world,
        snn=SnnConfig(epochs=150),
        adaptation=AdaptationConfig(population_reset=True),
    )


def test_a_learner_that_is_not_asked_to_watch_says_nothing_of_it():
    (row,) = play(batch(SMALL), 1)
    assert not {"detected", "suspect", "alarm_score", "forgotten"} & set(row)


@pytest.mark.parametrize("wheel", ["left", "right"])
def test_a_slow_wheel_is_found_named_forgotten_and_reacted_to(wheel):
    made = batch(broken(wheel))
    rows = play(made, 11)
    assert not any(row["detected"].any() for row in rows[:10])
    last = rows[10]
    assert last["detected"].mean() > 0.5
    named = last["suspect"][last["detected"] > 0].astype(int)
    assert {WheeledProblem.channels[name] for name in named} == {f"{wheel} wheel"}
    resets = made.learner.adaptations.resets(11).population
    assert np.array_equal(resets, last["detected"] > 0)
    assert last["forgotten"].sum() > np.mean([row["forgotten"].sum() for row in rows])
    for run, marks in enumerate(made.learner.memories[0].trials):
        assert len(marks) == made.learner.memories[0].buffer.counts[run]


def test_restored_goes_on_to_the_same_bytes():
    config = broken("left", onset=3)
    whole, cut, again = (batch(config) for _ in range(3))
    play(whole, 5)
    play(cut, 3)
    again.learner.restore({n: a.copy() for n, a in cut.learner.state().items()})
    play(again, 2, start=3)
    expected, found = whole.learner.state(), again.learner.state()
    assert expected.keys() == found.keys()
    for name, array in expected.items():
        assert array.tobytes() == found[name].tobytes(), name


@pytest.mark.parametrize(("left", "right"), [(0.1, 0.1), (0.2, 0.1), (-0.05, 0.1)])
def test_how_far_the_wheels_rolled_is_read_from_an_arc(left, right):
    turn = (right - left) / AXLE
    arc = (left + right) / 2
    chord = arc * np.sinc(turn / 2 / np.pi)
    moved = [chord * np.cos(turn / 2), chord * np.sin(turn / 2), turn]
    np.testing.assert_allclose(ways(np.array(moved)), [left, right], atol=1e-12)
