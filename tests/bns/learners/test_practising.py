"""BNS that practises in a model, which a diagnosis mends where the robot is another."""

from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment import diagnosing
from bns.experiment.batch import Batch
from bns.experiment.loading import with_learner
from bns.learners.practising import Practising
from bns.worlds.world import CountedWorld
from tests.bns.robots import wheels

SLOW, FAST = (f"wheel_gain:wheel=left,factor={factor}" for factor in (0.5, 1.0))
SMALL = {
    "evolution.population": 40,
    "evolution.generations": 5,
    "evolution.tournament": 8,
    "snn.epochs": 20,
    "compiled": "no",
    "settings.first": 4,
    "settings.anew": 6,
}


def batch(damage=f"{SLOW}@3", most=500, **own):
    """Two runs whose robot is damaged in trial 3, and what their models have spent."""
    base = replace(presets.load("khepera-simple"), replicates=2, trials=12, threads=1)
    told = {f"settings.{name}": value for name, value in own.items()}
    config = with_learner(base, "practising").with_({**SMALL, **told})
    models = [CountedWorld(wheels(), most) for _ in range(2)]
    return Batch([config], [wheels([damage])], models=models), models


@pytest.fixture
def named(monkeypatch):
    """What the diagnosis names, and of how many trials it was asked."""
    sets, asked = [(SLOW,)], []

    def name(self, trials):
        asked.append(len(trials))
        return list(sets)

    monkeypatch.setattr(Practising, "_named", name)
    return sets, asked


def rows(made, trials=8):
    """Columns of some trials, ``(T, R)`` each."""
    seen = [made.advance(trial)[0].columns for trial in range(trials)]
    return {name: np.stack([row[name] for row in seen]) for name in seen[0]}


def test_the_model_is_mended_by_what_the_diagnosis_names(named):
    made, models = batch()
    seen = rows(made)
    assert (seen["model_miss"][:3] < 0.05).all()
    assert (seen["model_miss"][3:6] > 0.2).all()  # at first, and until it is mended
    assert (seen["model_miss"][6:] < 0.05).all()
    np.testing.assert_array_equal(seen["mended"].sum(1), [0, 0, 0, 0, 0, 2, 0, 0])
    np.testing.assert_array_equal(seen["practised"][:, 0], [4, 2, 2, 2, 0, 0, 6, 2])
    assert named[1] == [3, 3]
    assert (seen["forgotten"][3] > 0).all()
    assert seen["forgotten"].sum() == seen["forgotten"][3].sum()
    assert all(0 < model.spent < 500 for model in models)


@pytest.mark.parametrize("sets", [[], [(FAST,)], [("no_effect",), (FAST,)]])
def test_a_model_that_stays_wrong_is_not_practised_in(named, sets):
    named[0][:] = sets
    seen = rows(batch()[0], 10)
    assert not seen["mended"].any()
    assert not seen["practised"][4:].any()
    assert named[1] == [3, 3, 6, 6]  # then again, with twice as many


def test_without_a_diagnosis_it_is_forgetting_alone(named):
    seen = rows(batch(diagnose=False)[0])
    assert not named[1]
    assert (seen["forgotten"][3] > 0).all()
    assert not seen["practised"][4:].any()


def test_a_robot_that_is_the_model_again_is_practised_in_again(named):
    named[0].clear()
    seen = rows(batch(f"{SLOW}@3..5")[0])
    assert (seen["practised"][6:] == 2).all()


def test_a_model_that_is_spent_is_asked_no_more(named):
    made, models = batch(most=6)
    seen = rows(made)
    assert all(model.left == 0 for model in models)
    assert np.isnan(seen["model_miss"][-1]).all()
    assert np.isfinite(seen["fitness"]).all()


def test_restored_in_the_middle_it_goes_on_to_the_same_bytes(named):
    whole, cut, again = (batch()[0] for _ in range(3))
    wanted = rows(whole)
    rows(cut, 5)
    again.learner.restore(cut.learner.state())
    seen = [again.advance(trial)[0].columns for trial in range(5, 8)]
    for name in ("fitness", "model_miss", "mended"):
        found = np.stack([row[name] for row in seen])
        np.testing.assert_array_equal(found, wanted[name][5:])


@pytest.mark.parametrize(
    ("given", "match"),
    [
        ({"watch.forget": True}, "watch.forget"),
        ({"prior.reality": (SLOW,)}, "no-diagnose"),
    ],
)
def test_settings_that_it_has_in_its_own_way(given, match):
    config = with_learner(presets.load("khepera-simple"), "practising").with_(given)
    model = CountedWorld(wheels(), 10)
    with pytest.raises(BnsError, match=match):
        Practising([config], replicates=[0], onsets=[-1], models=[model])


@pytest.mark.parametrize("robot", ["khepera3", "phantomx"])
def test_sets_that_the_diagnosis_fits_come_once_the_named_one_first(robot, monkeypatch):
    asked = []

    def diagnose(trials, model, **given):
        asked.append((model.name, given["seed"]))
        if not trials:
            raise BnsError("too few")
        fits = [SimpleNamespace(effects=e) for e in ((), (FAST,), (SLOW,))]
        return SimpleNamespace(best=fits[2], fits=fits)

    monkeypatch.setattr("bns.gap.diagnose.diagnose", diagnose)
    assert diagnosing.named(["a trial"], robot, seed=3) == [(SLOW,), (FAST,)]
    assert diagnosing.named([], robot) == []
    assert asked == [(robot, 3), (robot, 0)]
