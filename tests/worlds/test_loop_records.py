"""Records of closed loops: kept exactly, and honest about robots that were lost."""

import numpy as np
import pytest

from bns.errors import BnsError, FormatError
from bns.worlds import registry
from bns.worlds.damage import Damage, Event
from bns.worlds.data import dataset, dataset_checks
from bns.worlds.effects.base import BodyEffect, Parameter
from bns.worlds.trial import Commands, Trial


class Ahead:
    """Drives straight on at a speed."""

    def __init__(self, speed=0.12):
        self.speed = speed

    def memory(self, n):
        return np.zeros((n, 0))

    def act(self, readings, memory):
        return np.full((len(readings), 2), self.speed), memory


class Wild(BodyEffect):
    """Gravity that no solver survives."""

    name = "test_wild"
    doc = "gravity is scaled"
    parameters = (Parameter("factor", "1", 1.0, -1e30, 1e30, "", 2.0),)

    def edit(self, spec):
        spec.option.gravity = [0, 0, spec.option.gravity[2] * self["factor"]]


def test_a_dataset_keeps_readings_counters_and_handled_commands(tmp_path):
    world = registry.make("light", singles=True)
    trials = world.drive(Ahead(), cycles=30, seeds=[1, 2])
    assert sum(trial.handled.sum() for trial in trials) > 0
    dataset.write(tmp_path / "kept", trials)
    for kept, trial in zip(dataset.read(tmp_path / "kept").trials, trials, strict=True):
        assert kept.observed.tobytes() == trial.observed.tobytes()
        assert kept.outcome == trial.outcome
        assert np.array_equal(kept.handled, trial.handled)
        assert kept.conditions["lights"] == trial.conditions["lights"]


@pytest.mark.parametrize("given", [[3], [-1], ["0"], 1, [True]])
def test_handled_commands_that_there_are_not_are_refused(given, tmp_path):
    with pytest.raises(FormatError, match=r"handled .* indices of the 3 commands"):
        dataset_checks.handled({"handled": given}, 3, tmp_path)


def test_handled_needs_an_entry_for_each_command():
    with pytest.raises(BnsError, match=r"handled has shape \(1,\), it needs \(2,\)"):
        Trial(
            commands=Commands(np.zeros((2, 2)), [1.0, 1.0]),
            times=np.arange(3.0),
            observed=np.zeros((3, 3)),
            boundaries=[0, 1, 2],
            handled=[True],
        )


def test_a_robot_that_diverges_is_flagged_and_leaves_the_others_alone():
    wild = Damage((Event(Wild({"factor": -1e30}), onset_time=1.0),))
    starts = np.array([[0.8, 0.0, 2.0], [0.8, 0.0, 2.0]])
    world = registry.make("light", damage=[wild, Damage.none()])
    bad, good = world.drive(Ahead(0.05), cycles=6, seeds=[1, 1], starts=starts)
    sound = registry.make("light").drive(
        Ahead(0.05), cycles=6, seeds=[1], starts=starts[:1]
    )[0]
    assert bad.outcome.diverged and not bad.outcome.usable
    assert not good.outcome.diverged
    assert good.observed.tobytes() == sound.observed.tobytes()
    assert np.isnan(bad.poses_world[-1]).all()
    assert np.isfinite(bad.observed[:, 3:]).all()  # its last readings are held
    early = bad.times <= 1.0
    assert bad.observed[early].tobytes() == good.observed[early].tobytes()


def test_no_robots_give_no_trials():
    assert registry.make("light").drive(Ahead(), starts=np.zeros((0, 3))) == []
    with pytest.raises(BnsError, match="There is no robot"):
        registry.make("light").session(starts=np.zeros((0, 3)))


def test_starts_are_drawn_by_seed_and_trial_and_keep_clear():
    world = registry.make("light")
    starts = [
        trial.poses_world[0]
        for number in (0, 1)
        for trial in world.drive(Ahead(), cycles=1, seeds=[1, 2, 3], trial=number)
    ]
    assert len({tuple(start) for start in starts}) == 6
    assert min(np.hypot(x, y) for x, y, _ in starts) >= 0.5
    again = world.drive(Ahead(), cycles=1, seeds=[2])[0]
    assert np.array_equal(again.poses_world[0], starts[1])
