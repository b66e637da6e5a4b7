"""NEAT in light following: what it heeds, its model, islands, its networks."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets
from bns.campaign.identity import identity
from bns.draws import Draws
from bns.errors import BnsError
from bns.experiment.loading import from_mapping, to_mapping, with_learner
from bns.learners.neat import Genomes, Neat, NeatControllers
from bns.tasks.light_controller import GenomePolicy
from bns.worlds.world import CountedWorld
from tests.bns.robots import FakeLightWorld

KIND = NeatControllers(5, False, -0.1, 0.1, 0.0, most=20)


def config(**changes):
    cut = {"light.cycles": 12, "light.circle_cycles": 5, "light.starts": 2}
    sizes = {"settings.population": 12, "settings.generations": 2, "snn.epochs": 4}
    found = with_learner(presets.load("khepera-light"), "neat")
    found = found.with_({**cut, **sizes, **changes})
    return replace(found, trials=4, replicates=2, threads=1)


def made(given, evaluations=0):
    models = [CountedWorld(FakeLightWorld(), evaluations) for _ in range(2)]
    told = {"replicates": [0, 1], "onsets": [-1, -1]}
    return Neat([given] * 2, **told, models=models if evaluations else ())


def cost_from(learner, run, seed):
    """Cost of a run's population, all from one start."""
    genes, lengths = learner.population
    rows = learner.population._replace(
        genes=genes[run].unsqueeze(1), lengths=lengths[run].unsqueeze(1)
    )
    tried = learner.problem.controllers(rows)
    seeds = [seed] * len(tried)
    trials = learner.task.execute(FakeLightWorld(), tried, trial=0, seeds=seeds)
    return learner.task.fitness(trials)


class TestSettings:
    def test_it_has_the_networks_of_bns_and_evolution_of_its_own(self):
        light, mine = presets.load("khepera-light"), config()
        assert mine.snn == replace(light.snn, epochs=4)
        assert mine.choose == light.choose
        with pytest.raises(BnsError, match="belongs to the learner 'bns'"):
            mine.with_({"evolution.generations": 3})

    def test_what_it_heeds_is_kept_and_is_part_of_its_identity(self):
        other = config(**{"snn.epochs": 5})
        assert from_mapping(to_mapping(other)) == other
        assert identity(other) != identity(config())

    def test_rates_of_bns_after_damage_are_refused(self):
        with pytest.raises(BnsError, match="rates of its own"):
            made(config(**{"adaptation.mutation_rate_after": 0.5}))

    def test_too_few_connections_are_refused(self):
        with pytest.raises(BnsError, match=r"settings\.most = 4"):
            made(config(**{"settings.most": 4}))


class TestPrior:
    def test_whole_generations_in_the_model_and_its_best_is_deployed(self):
        learner = made(config(), evaluations=50)
        proposal = learner.propose(0)
        assert [model.spent for model in learner.models] == [48, 48]
        shown = proposal.best or proposal.tried
        genes = learner.population.genes[0, learner.cost[0].argmin(), :, 0]
        assert torch.equal(shown[0].genome, genes)

    def test_what_evolved_in_it_does_better_than_random_networks(self):
        more = {"light.cycles": 60, "settings.population": 30}
        evolved, random = (
            made(config(**more), evaluations=count) for count in (600, 30)
        )
        for learner in (evolved, random):
            learner.propose(0)
        seeds = range(1000, 1010)  # starts that neither has seen
        costs = [
            np.mean([cost_from(learner, run, seed) for seed in seeds], axis=0)
            for learner in (evolved, random)
            for run in (0, 1)
        ]
        assert max(map(np.median, costs[:2])) < 0.7 * min(map(np.median, costs[2:]))

    def test_too_few_evaluations_are_refused(self):
        with pytest.raises(BnsError, match=r"prior\.evaluations = 5"):
            made(config(), evaluations=5).propose(0)


def test_islands_are_populations_of_their_own():
    learner = made(config(**{"light.islands": 2, "settings.population": 16}))
    world = FakeLightWorld()
    for trial in range(3):
        tried = learner.propose(trial).tried
        trials = learner.task.execute(world, tried, trial=trial, seeds=[0, 1])
        row = learner.observe(trial, trials, None)
    assert learner.population.genes.shape[:2] == (4, 8)
    assert (row["species"] >= 2).all()


class TestNetworks:
    def test_without_hidden_nodes_by_hand(self):
        genome = torch.zeros(1, KIND.genes)
        weights = np.array([1.0, -2.0, 0.5, 3.0, -1.0, 0.25])  # to left, right in turn
        genome[0] = torch.from_numpy(KIND.ends.first(weights, 20).ravel())
        policy = GenomePolicy(KIND, genome)
        speeds, _ = policy.act(np.array([[4095 * 0.2, 4095 * 0.7]]), policy.memory(1))
        driven = 0.8 * weights[:2] + 0.3 * weights[2:4] + weights[4:]
        told = 0.1 * np.tanh(4.9 / 2 * driven)
        np.testing.assert_allclose(speeds[0], told, rtol=1e-5)

    def test_robots_of_a_batch_do_not_mix(self):
        genes = Genomes(KIND, 2.5).random(1, 4, Draws(3)).genes[0, :, :, 0]
        readings = np.linspace(0, 4095, 8).reshape(4, 2)
        together, _ = GenomePolicy(KIND, genes).act(readings, np.zeros((4, 0)))
        for robot in range(4):
            alone = GenomePolicy(KIND, genes[[robot]])
            one, _ = alone.act(readings[[robot]], np.zeros((1, 0)))
            np.testing.assert_allclose(one[0], together[robot], rtol=1e-6)

    def test_another_length_is_refused(self):
        with pytest.raises(BnsError, match="has 100"):
            GenomePolicy(KIND, torch.zeros(1, 7))
