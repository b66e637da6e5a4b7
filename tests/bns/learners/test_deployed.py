"""The controller that BNS deploys: what worked, until there is evidence of a change."""

from dataclasses import replace

import numpy as np
import pytest

from bns.experiment.batch import Batch
from bns.experiment.run import train
from bns.learners.bns.choice import AGE, PAUSE, Deployed, packed, unpack
from tests.bns import robots


def genes(number):
    return np.full((2, 3), number, np.float32)


def noted(run, costs, first=0, foreseen=None):
    """One controller a trial, each with its cost, as foreseen unless said otherwise."""
    for at, (number, cost) in enumerate(costs):
        run.note(
            first + at, genes(number), 2, cost, cost if foreseen is None else foreseen
        )
    return run


class TestWhatIsDeployed:
    def test_the_lowest_cost_seen_where_nothing_is_left_to_chance(self):
        run = noted(Deployed(True), [(1, 5.0), (2, 3.0), (3, 4.0)])
        assert run.best.genes[0, 0] == 2

    def test_a_lucky_one_is_not_believed_where_much_is(self):
        costs = [(1, 5.0), (1, 7.0), (1, 5.0), (1, 7.0), (1, 6.0), (2, 5.6)]
        run = noted(Deployed(False), costs)
        assert run.best.genes[0, 0] == 1
        assert run.wanted(6) is None  # one was tried again just now
        assert run.wanted(4 + PAUSE + 1).genes[0, 0] == 2  # but it may be better

    def test_nothing_is_known_at_first(self):
        assert Deployed(True).best is None and Deployed(True).wanted(0) is None


class TestChange:
    def test_one_that_does_much_worse_again_tells_of_another_robot(self):
        run = noted(Deployed(True), [(1, -100.0), (2, -80.0), (1, -50.0)])
        assert run.changed == 2
        assert [item.genes[0, 0] for item in run.seen] == [1]
        assert run.best.costs == [-50.0]

    def test_a_little_worse_does_not(self):
        run = noted(Deployed(True), [(1, -100.0), (2, -80.0), (1, -95.0)])
        assert run.changed == -1 and len(run.seen) == 2

    def test_what_was_seen_before_the_learner_forgot_is_dropped(self):
        run = noted(Deployed(True), [(1, 1.0), (2, 2.0), (3, 3.0)])
        run.forget(before=2, trial=2)
        assert run.best.genes[0, 0] == 3


class TestDoubt:
    def test_the_deployed_one_is_tried_again_after_some_trials(self):
        run = noted(Deployed(True), [(1, 1.0), *((n, 2.0) for n in range(2, AGE + 1))])
        assert run.wanted(AGE - 1) is None
        assert run.wanted(AGE).genes[0, 0] == 1

    def test_and_at_once_after_a_surprise(self):
        run = noted(Deployed(True), [(n, 1.0 + n / 10) for n in range(6)], foreseen=1.0)
        assert run.wanted(6) is None
        run.note(6, genes(9), 2, 50.0, 1.0)
        assert run.wanted(7).genes[0, 0] == 0
        run.note(7, genes(0), 2, 1.0, 1.0)  # it does as before
        assert not run.surprised and run.wanted(8) is None


def test_it_comes_back_from_plain_arrays():
    runs = [noted(Deployed(True), [(1, 5.0), (2, 3.0), (2, 3.1)]), Deployed(True)]
    held = packed(runs, (2, 3))
    again = [Deployed(True), Deployed(True)]
    unpack(again, held)
    for name, value in packed(again, (2, 3)).items():
        assert value.tobytes() == held[name].tobytes(), name
    assert again[0].best.costs == [3.0, 3.1] and again[1].best is None


class Broken(robots.Slider):
    """From trial 12 on it gets a third as far."""

    def run(self, commands, *, trial=0, seeds=()):
        found = super().run(commands)
        if trial < 12:
            return found
        return [t.replace(observed=t.observed / 3) for t in found]


def deploying(**changes):
    return replace(robots.small(**changes), deploy="seen")


def test_deployed_it_goes_as_far_as_was_seen_since_the_robot_changed():
    batch = Batch([deploying(trials=30)], [Broken()])
    rows = [batch.advance(trial)[0].columns for trial in range(30)]
    seen, best = (
        np.stack([np.sqrt(-row[name]) for row in rows], 1)
        for name in ("fitness", "fitness_best")
    )
    until = np.maximum.accumulate(seen, axis=1)
    np.testing.assert_allclose(best[:, 1:12], until[:, :11], rtol=1e-5)
    for kept in batch.learner.deployed:
        assert 12 <= kept.changed <= 12 + AGE
        since = seen[:, kept.changed :].max(1)
        assert np.isclose(best[:, -1], since, rtol=1e-5).any()
    assert np.stack([row["retried"] for row in rows]).mean() <= 1 / (PAUSE + 1)


@pytest.mark.parametrize("small", [deploying, None])
def test_killed_and_resumed_it_gives_the_same_bytes(tmp_path, small):
    config = deploying(trials=8)
    world = robots.Slider()
    if small is None:
        config = replace(robots.small_light(), deploy="seen", trials=8)
        world = robots.FakeLightWorld()
    whole, cut = tmp_path / "whole", tmp_path / "cut"
    record = train(config, whole, world=world)
    asked = iter([False] * 5 + [True])
    train(config, cut, world=world, stop=lambda: next(asked))
    train(config, cut, world=world, resume=True)
    assert (whole / "state.npz").read_bytes() == (cut / "state.npz").read_bytes()
    assert {"solved_best", "retried"} <= set(record.columns)


def test_off_it_is_as_it_was():
    record = train(robots.small(trials=3), world=robots.Slider())
    assert not {"solved_best", "retried"} & set(record.columns)


def test_a_report_shows_deployed_and_tried_apart(tmp_path):
    from bns.viz import report

    record = train(deploying(trials=6), world=robots.Slider())
    page = report.write(record, tmp_path / "r.html").read_text()
    assert "Deployed, it solves" in page
    plain = train(robots.small(trials=3), world=robots.Slider())
    assert "Deployed" not in report.write(plain, tmp_path / "p.html").read_text()
