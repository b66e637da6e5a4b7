"""IT&E and sIT&E on a robot whose answer is known, with a map made in a model."""

from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError, UnknownNameError
from bns.experiment.batch import Batch
from bns.experiment.loading import with_learner
from bns.experiment.world_factory import make_world
from bns.learners import registry
from bns.learners.safe_ite import improvement
from bns.prior import maker
from bns.worlds.world import CountedWorld
from tests.bns.robots import Slider

WALK = replace(presets.load("hexapod-walk"), threads=1, replicates=2, trials=30)
ONSET = 3


class Damaged(Slider):
    """From trial `ONSET` on it holds the robot back to be on legs 1 and 2."""

    def run(self, commands, *, trial=0, seeds=()):
        found = super().run(commands)
        return found if trial < ONSET else [self._worse(item) for item in found]

    def _worse(self, trial):
        down = (trial.commands.values[:, [1, 4]] <= 0).mean()
        poses = trial.observed.copy()
        poses[:, 0] *= (1.0 - down) ** 3
        return replace(trial, observed=poses)


@pytest.fixture(scope="module")
def repertoire(tmp_path_factory):
    path = tmp_path_factory.mktemp("maps") / "m.npz"
    plan = maker.Plan(config=WALK, behaviour="told", step=0.0)
    made = maker.Maker(plan, Slider())
    maker.make(made, path, evaluations=3000, command="c")
    return str(path)


def config(repertoire, learner="ite", **settings):
    damage = f"leg_raised:legs=1,2,blend=1@{ONSET}"
    changes = {f"settings.{name}": value for name, value in settings.items()}
    told = {"prior.repertoire": repertoire, "world.damage": [damage]}
    return with_learner(WALK, learner).with_({**told, **changes})


def rows(config, trials=20):
    batch = Batch([config], [Damaged()])
    steps = [batch.advance(trial)[0].columns for trial in range(trials)]
    return {name: np.stack([step[name] for step in steps], 1) for name in steps[0]}


def test_on_the_robot_of_the_map_the_first_test_is_the_last(repertoire):
    found = rows(config(repertoire), ONSET)
    assert (found["tests"] == 1).all()
    np.testing.assert_allclose(found["worth_seen"], found["worth_foreseen"], rtol=1e-5)


@pytest.mark.parametrize("learner", ["ite", "safe_ite"])
def test_after_damage_it_finds_what_does_not_need_those_legs(repertoire, learner):
    found = rows(config(repertoire, learner))
    before, first, last = (found["worth_seen"][:, at] for at in (0, ONSET, -1))
    assert (first < 0.5 * before).all()
    assert (last > 1.5 * first).all() and (found["tests"][:, -1] <= 20).all()
    deployed = np.sqrt(-found["fitness_best"][:, ONSET + 1 :]) / 100
    assert (np.diff(deployed, axis=1) >= -1e-9).all()  # what is seen to work is kept


def test_nobody_tells_and_it_sees_for_itself(repertoire):
    found = rows(config(repertoire, told="never"))
    assert (found["tests"][:, ONSET] == 1).all()
    assert (found["tests"][:, -1] > 1).all()
    assert (found["worth_seen"][:, -1] > 1.5 * found["worth_seen"][:, ONSET]).all()


def test_the_map_that_ships_foresees_the_intact_hexapod():
    """It was made at steps of 8 ms, the world has 4 ms: not the same, but near."""
    told = {"prior.repertoire": "phantomx-1", "world.damage": []}
    one = replace(with_learner(WALK, "ite").with_(told), replicates=1)
    batch = Batch([one], [make_world(one)])
    rows = [batch.advance(trial)[0].columns for trial in range(2)]
    assert rows[0]["worth_seen"] == pytest.approx(rows[0]["worth_foreseen"], rel=0.1)
    assert rows[1]["tests"] == 1 and rows[1]["fitness"] == rows[1]["fitness_best"]


def test_it_stops_at_the_most_tests(repertoire):
    found = rows(config(repertoire, most=4, stop=1.0))
    assert found["tests"].max() == 4


def test_without_a_map_each_run_makes_one_with_all_its_evaluations(repertoire):
    plain = with_learner(WALK, "ite")
    models = [CountedWorld(Slider(), 300) for _ in range(2)]
    learner = registry.get("ite")(
        [plain] * 2, replicates=[0, 1], onsets=[-1, -1], models=models
    )
    tried = learner.propose(0).tried
    assert [model.spent for model in models] == [300, 300]
    ways = learner.task.worth(Slider().run(tried))
    assert (ways >= [known.worth.max() for known in learner.maps]).all()


def test_expected_improvement_is_the_textbook_formula():
    found = improvement(np.array([1.0, 3.0, 0.0]), np.array([1.0, 1e-12, 1e-12]), 1.0)
    np.testing.assert_allclose(found, [1 / np.sqrt(2 * np.pi), 2.0, 0.0], atol=1e-8)


def test_what_did_harm_is_not_tried_again_by_sit_and_e(repertoire):
    """The same robot, but the best gait of the map falls."""
    one = registry.get("safe_ite")(
        [config(repertoire, "safe_ite")], replicates=[0], onsets=[-1]
    )
    tests, known = one.tests[0], one.maps[0]
    best = int(known.worth.argmax())
    tests.at, tests.seen, tests.harm = [best], [0.5 * known.worth[best]], [1.0]
    spread = np.full(len(known.worth), 0.1)
    wanted = one.wanted(tests, known, known.worth, spread)
    assert wanted[best] < 1e-6 * wanted.max()


class TestRefused:
    def test_a_repertoire_of_another_robot(self, repertoire):
        with pytest.raises(BnsError, match="not of 'quad'"):
            rows(config(repertoire).with_({"world.robot": "quad"}), 1)

    def test_a_repertoire_for_a_task_that_it_does_not_know(self, repertoire):
        other = with_learner(presets.load("khepera-simple"), "ite")
        with pytest.raises(BnsError, match="of the task 'walk'"):
            Batch([other.with_({"prior.repertoire": repertoire})], [Slider()])

    def test_one_that_is_not_there(self):
        with pytest.raises(UnknownNameError, match="repertoire"):
            rows(config("phantomx-99"), 1)
