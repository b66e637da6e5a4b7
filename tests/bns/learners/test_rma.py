"""Policies trained on robots damaged at random, alone and with RMA's adaptation."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets
from bns.errors import BnsError
from bns.experiment.loading import with_learner
from bns.learners.domain_randomised import DomainRandomised, Situations
from bns.learners.rma import CYCLE, Patterns, Rma, RmaControllers
from bns.tasks.light import readings
from bns.tasks.light_controller import Controllers, GenomePolicy, brightness
from bns.worlds.world import CountedWorld
from tests.bns.robots import FakeLightWorld

TOLD = RmaControllers(3, False, -0.1, 0.1, 0.0, latent=2)
PAST = replace(TOLD, past=4, neurons=5)


def config(**changes):
    base = randomised()
    own = {f"settings.{n}": v for n, v in FEW.items()}
    return with_learner(base, "rma").with_({**own, "settings.steps": 300, **changes})


def made(given, evaluations=400):
    models = [CountedWorld(FakeLightWorld(), evaluations) for _ in range(2)]
    told = {"replicates": [0, 1], "onsets": [-1, -1]}
    return Rma([given] * 2, **told, models=models)


class TestNetworks:
    def test_numbers_in_the_genome_are_a_bias_of_the_hidden_neurons(self):
        rng = np.random.default_rng(0)
        layer, bias = rng.normal(size=(3, 4)), rng.normal(size=3)
        rest, numbers = rng.normal(size=8), np.array([0.7, -0.2])
        genome = np.concatenate([layer.ravel(), bias, rest, numbers])
        plain = Controllers(3, False, -0.1, 0.1, 0.0)
        same = np.concatenate(
            [layer[:, :2].ravel(), bias + layer[:, 2:] @ numbers, rest]
        )
        seen = rng.uniform(0, 4095, (1, 2))
        one, other = (
            GenomePolicy(kind, torch.from_numpy(row[None]).float())
            for kind, row in ((TOLD, genome), (plain, same))
        )
        np.testing.assert_allclose(
            one.act(seen, one.memory(1))[0],
            other.act(seen, other.memory(1))[0],
            rtol=1e-5,
        )

    def test_the_module_takes_the_place_of_the_numbers(self):
        rng = np.random.default_rng(1)
        rows = torch.from_numpy(rng.normal(size=(2, PAST.genes))).float()
        policy = GenomePolicy(PAST, rows)
        memory, seen = rng.normal(size=(2, 4 * CYCLE)), rng.uniform(0, 4095, (2, 2))
        speeds, kept = policy.act(seen, memory)
        for robot, row in enumerate(rows.double().numpy()):
            net, w1, b1, w2, b2 = np.split(
                row, PAST.base.genes + np.cumsum([0, *PAST.sizes[:-1]])
            )
            hidden = np.tanh(w1.reshape(5, 16) @ memory[robot] + b1)
            numbers = w2.reshape(2, 5) @ hidden + b2
            told = torch.from_numpy(np.append(net, numbers)[None]).float()
            alone = GenomePolicy(TOLD, told)
            np.testing.assert_allclose(
                alone.act(seen[[robot]], alone.memory(1))[0][0],
                speeds[robot],
                rtol=1e-4,
            )
        np.testing.assert_array_equal(kept[:, : 3 * CYCLE], memory[:, CYCLE:])
        np.testing.assert_allclose(kept[:, -4:-2], brightness(seen))
        np.testing.assert_allclose(0.1 * kept[:, -2:], speeds, atol=1e-7)

    def test_outputs_in_the_dead_band_are_remembered_as_the_same(self):
        kind = replace(PAST, dead_band=0.05)
        rng = np.random.default_rng(2)
        rows = torch.from_numpy(0.1 * rng.normal(size=(2, kind.genes))).float()
        policy = GenomePolicy(kind, rows)
        speeds, kept = policy.act(rng.uniform(0, 4095, (2, 2)), policy.memory(2))
        np.testing.assert_array_equal(speeds, 0)
        np.testing.assert_array_equal(kept[:, -2:], 0)

    def test_another_length_is_refused(self):
        with pytest.raises((BnsError, RuntimeError)):
            GenomePolicy(PAST, torch.zeros(1, 7))


class Listening(GenomePolicy):
    """A policy that keeps what it remembered."""

    def act(self, readings, memory):
        self.__dict__.setdefault("heard", []).append(memory)
        return super().act(readings, memory)


def test_the_module_learns_from_what_the_policy_remembers():
    learner = made(config())
    tried = learner.propose(0).tried
    policy = Listening.of(tried)
    trials = FakeLightWorld().drive(policy, cycles=40, seeds=[5, 6])
    said = np.array([[0.0, 1.0], [2.0, 3.0]])
    found = learner.patterns(trials, said)
    heard = np.stack(policy.heard, 1)
    assert len(readings(trials[0])) == 41
    np.testing.assert_allclose(found.known.reshape(2, 40, -1), heard, atol=1e-5)
    np.testing.assert_array_equal(found.wanted.reshape(2, 40, 2)[:, 0], said)


def test_all_evaluations_are_counted_and_none_are_beyond_the_limit():
    learner = made(config())
    learner.propose(0)
    # 400: three rounds of 20 drives; of 340 three bests of four, and 20 generations
    assert [model.spent for model in learner.models] == [60 + 12 + 320] * 2
    learner.propose(1)
    assert [model.spent for model in learner.models] == [392] * 2


def test_the_module_learns_what_is_planted_and_says_how_well():
    learner = made(config(**{"settings.steps": 1000}))
    rng, memory = np.random.default_rng(3), learner.memories[0]
    known = rng.normal(size=(3000, learner.adapting.memory))
    wanted = np.tanh(known[:, :2] - known[:, 2:4])
    held = np.arange(3000) % 5 == 4
    learner.fit(memory, [Patterns(known, wanted, held)], rng)
    assert memory.miss < 0.35
    noise = rng.normal(size=wanted.shape)
    other = learner.memories[1]
    learner.fit(other, [Patterns(known, noise, held)], rng)
    assert 0.9 < other.miss < 1.3  # nothing can be said, and it is not learned by heart


def test_a_trained_run_says_how_well_its_module_does():
    learner = made(config())
    tried = learner.propose(0).tried
    trials = FakeLightWorld().drive(GenomePolicy.of(tried), cycles=40, seeds=[1, 2])
    row = learner.observe(0, trials, None)
    assert np.isfinite(row["encoding_miss"]).all()
    assert (row["encoding_miss"] > 0).all()


FEW = {"population": 8, "situations": 2, "finalists": 3, "judged": 4}


def randomised(**changes):
    cut = {"light.cycles": 40, "light.circle_cycles": 10, "light.hidden": 3}
    own = {f"settings.{name}": value for name, value in FEW.items()}
    found = with_learner(presets.load("khepera-light-recover"), "domain_randomised")
    found = found.with_({"world.damage": [], **cut, **own, **changes})
    return replace(found, trials=3, replicates=2, threads=1)


def trained(given, evaluations=12 + 16 * 3):
    models = [CountedWorld(FakeLightWorld(), evaluations) for _ in range(2)]
    told = {"replicates": [0, 1], "onsets": [-1, 1]}
    return DomainRandomised([given] * 2, **told, models=models)


def genomes(proposal):
    return np.stack([one.genome.numpy() for one in proposal.tried])


def test_it_spends_whole_generations_and_the_choice_before_the_first_trial():
    learner = trained(randomised(), evaluations=12 + 16 * 3 + 7)
    first = learner.propose(0)
    assert [model.spent for model in learner.models] == [60, 60]
    assert first.best is None
    for trial in (1, 2):  # one run is told of damage at trial 1, and heeds it not
        np.testing.assert_array_equal(genomes(learner.propose(trial)), genomes(first))
    assert [model.spent for model in learner.models] == [60, 60]


def test_too_few_evaluations_are_refused():
    with pytest.raises(BnsError, match=r"prior\.evaluations = 27 is less than the 28"):
        trained(randomised(), evaluations=27)


def test_what_it_trained_does_better_than_random_controllers():
    learner = trained(randomised(), evaluations=12 + 16 * 40)
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
    learner = trained(randomised())
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
    trained(randomised(**{"settings.random": False})).propose(0)
    assert len(met) == 120
    assert all(FakeLightWorld([one]).gains(1).tolist() == [[1, 1]] for one in met)


def test_a_range_of_its_own_takes_the_place_of_the_tasks():
    own = ["wheel_gain:wheel=left,factor=0.9..1"]
    learner = trained(randomised(**{"settings.unknown": own}))
    assert len(learner.unknowns) == 1
    learner.propose(0)
    with pytest.raises(BnsError, match="no effect with a range"):
        trained(randomised(**{"settings.unknown": ["wheel_gain:wheel=left,factor=1"]}))
