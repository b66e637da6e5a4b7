"""A policy trained on robots damaged at random: budget, what it meets, what it does."""

from dataclasses import replace

import numpy as np
import pytest

from bns import presets
from bns.errors import BnsError
from bns.experiment.loading import with_learner
from bns.learners.domain_randomised import DomainRandomised, Situations
from bns.worlds.world import CountedWorld
from tests.bns.robots import FakeLightWorld

FEW = {"population": 8, "situations": 2, "finalists": 3, "judged": 4}


def config(**changes):
    cut = {"light.cycles": 40, "light.circle_cycles": 10, "light.hidden": 3}
    own = {f"settings.{name}": value for name, value in FEW.items()}
    found = with_learner(presets.load("khepera-light-recover"), "domain_randomised")
    found = found.with_({"world.damage": [], **cut, **own, **changes})
    return replace(found, trials=3, replicates=2, threads=1)


def made(given, evaluations=12 + 16 * 3):
    models = [CountedWorld(FakeLightWorld(), evaluations) for _ in range(2)]
    told = {"replicates": [0, 1], "onsets": [-1, 1]}
    return DomainRandomised([given] * 2, **told, models=models)


def genomes(proposal):
    return np.stack([one.genome.numpy() for one in proposal.tried])


def test_it_spends_whole_generations_and_the_choice_before_the_first_trial():
    learner = made(config(), evaluations=12 + 16 * 3 + 7)
    first = learner.propose(0)
    assert [model.spent for model in learner.models] == [60, 60]
    assert first.best is None
    for trial in (1, 2):  # one run is told of damage at trial 1, and heeds it not
        np.testing.assert_array_equal(genomes(learner.propose(trial)), genomes(first))
    assert [model.spent for model in learner.models] == [60, 60]


def test_too_few_evaluations_are_refused():
    with pytest.raises(BnsError, match=r"prior\.evaluations = 27 is less than the 28"):
        made(config(), evaluations=27)


def test_what_it_trained_does_better_than_random_controllers():
    learner = made(config(), evaluations=12 + 16 * 40)
    tried = learner.propose(0).tried
    rng, task = np.random.default_rng(0), learner.task
    seeds = list(range(100, 140))
    any_one = task.space.controllers(task.space.random(40, rng))
    world = FakeLightWorld()
    told = {"trial": 0, "seeds": seeds}
    random = task.fitness(task.execute(world, any_one, **told)).mean()
    for one in tried:
        cost = task.fitness(task.execute(world, [one] * 40, **told)).mean()
        assert cost < 0.7 * random


def test_situations_lie_in_the_range_and_the_first_is_undamaged():
    learner = made(config())
    for random in (True, False):
        rng = np.random.default_rng(1)
        told = (learner.light, learner.unknowns, learner.models[0], rng)
        points, seeds = Situations(*told, random=random).draw(50)
        gains = learner.unknowns.values(points)
        np.testing.assert_allclose(gains[0], 1.0)
        assert gains.min() >= 0.5 and gains.max() <= 1.2
        assert (gains.std(0) > 0.1).all() == random
        assert len(set(seeds.tolist())) == 50


def test_without_damage_at_random_the_model_is_the_undamaged_robot(monkeypatch):
    met = []
    having = CountedWorld.having

    def listen(self, damages):
        met.extend(damages)
        return having(self, damages)

    monkeypatch.setattr(CountedWorld, "having", listen)
    made(config(**{"settings.random": False})).propose(0)
    assert len(met) == 120
    assert all(FakeLightWorld([one]).gains(1).tolist() == [[1, 1]] for one in met)


def test_a_range_of_its_own_takes_the_place_of_the_tasks():
    own = ["wheel_gain:wheel=left,factor=0.9..1"]
    learner = made(config(**{"settings.unknown": own}))
    assert len(learner.unknowns) == 1
    learner.propose(0)
    with pytest.raises(BnsError, match="no effect with a range"):
        made(config(**{"settings.unknown": ["wheel_gain:wheel=left,factor=1"]}))
