"""The static SNN: random trials, one training, one transfer, and nothing after."""

from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.batch import Batch
from bns.experiment.loading import from_mapping, to_mapping, with_learner
from bns.worlds import registry as worlds

SLOW = "wheel_gain:wheel=left,factor=0.5"
RANDOM, TRIALS = 5, 8


def config(**told):
    base = replace(presets.load("khepera-simple"), trials=TRIALS, replicates=2)
    base = with_learner(replace(base, threads=1), "static_snn")
    own = {"settings.commands": 36 * RANDOM - 1, "settings.generations": 30}
    cut = {"compiled": "no", "snn.epochs": 60, "world.damage": []}
    return base.with_({**cut, **own, **told})


def ran(damage=(), **told):
    """Columns ``(T, R)`` of a batch, the commands tried, and its learner."""
    made = config(**told, **{"world.damage": list(damage)})
    world = worlds.make("static-snn", robot="khepera3", damage=damage)
    batch = Batch([made], [world])
    rows = [batch.advance(trial)[0] for trial in range(TRIALS)]
    names = rows[-1].columns
    columns = {name: np.array([row.columns[name] for row in rows]) for name in names}
    return columns, np.array([row.arrays["sent"] for row in rows]), batch.learner


class TestARun:
    def test_random_lists_are_all_different_and_of_full_length(self):
        columns, sent, _ = ran()
        assert (columns["commands"][:RANDOM] == 36).all()
        lists = {row.tobytes() for row in sent[:RANDOM].reshape(2 * RANDOM, -1)}
        assert len(lists) == 2 * RANDOM

    def test_what_was_transferred_is_tried_from_then_on(self):
        _, sent, _ = ran()
        for later in sent[RANDOM + 1 :]:
            np.testing.assert_array_equal(later, sent[RANDOM])
        assert not np.array_equal(sent[RANDOM], sent[RANDOM - 1])

    def test_it_is_trained_on_random_trials_alone_and_once(self):
        columns, _, learner = ran()
        assert (columns["patterns"][RANDOM - 1 :] == 36 * RANDOM).all()
        assert np.isnan(columns["snn_loss"][: RANDOM - 1]).all()
        assert (np.diff(columns["snn_loss"][RANDOM - 1 :], axis=0) == 0).all()
        assert (columns["snn_loss"][-1] < 0.05).all()
        assert learner.random_trials == RANDOM

    def test_more_generations_find_what_costs_less_inside_the_snn(self):
        few, many = (
            ran(**{"settings.generations": count})[0]["fitness_predicted"][-1]
            for count in (0, 60)
        )
        assert (many < few).all()

    def test_of_damage_it_learns_nothing(self):
        sound, sent, _ = ran()
        columns, same, _ = ran([f"{SLOW}@{RANDOM + 1}"])
        np.testing.assert_array_equal(sent, same)
        for name in ("snn_loss", "fitness_predicted"):
            last = slice(RANDOM, None)
            np.testing.assert_array_equal(sound[name][last], columns[name][last])
        errors = columns["snn_turn"][RANDOM:]
        assert (errors[1:] > 5 * errors[0]).all()


def test_no_trial_left_for_what_evolves_is_refused():
    with pytest.raises(BnsError, match="give fewer commands, or more trials"):
        Batch([config(**{"settings.commands": 36 * TRIALS})], [None])


def test_settings_of_bns_that_it_heeds_are_its_own_and_others_are_refused():
    made = config(**{"evolution.population": 40})
    assert from_mapping(to_mapping(made)) == made
    assert made.adaptation.window == 0  # that of the preset is of BNS alone
    with pytest.raises(BnsError, match="would not heed it"):
        config(**{"adaptation.window": 10})
    back = with_learner(made, "bns")
    assert back.evolution.population == 40
    assert with_learner(back, "random").evolution.population == 100


def test_runs_with_islands_draw_one_random_controller_each():
    told = {"trials": 3, "replicates": 2, "compiled": "no"}
    base = replace(presets.load("khepera-light-recover"), threads=1)
    base = with_learner(base, "static_snn")
    own = {"settings.commands": 40, "settings.generations": 2, "settings.trainings": 1}
    made = base.with_({**told, **own, "snn.epochs": 5, "world.damage": []})
    world = worlds.make("light", robot=made.world.robot, damage=())
    batch = Batch([made], [world])
    for trial in range(3):
        batch.advance(trial)
    assert made.light.islands > 1
    assert np.isfinite(batch.learner.cost.numpy()).all()
