"""NEAT: its parts and exclusive or; in light following its model, islands, networks."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bench.rivals.networks import ENDS, RULE, answers, exclusive_or
from bns import presets
from bns.campaign.identity import identity
from bns.draws import Draws
from bns.errors import BnsError
from bns.evolution.neat import (
    Lineage,
    NeatSettings,
    bred,
    crossed,
    distance,
    shared_out,
)
from bns.evolution.topology import (
    ENABLED,
    INNOVATION,
    SLOPE,
    SOURCE,
    TARGET,
    WEIGHT,
    Marks,
    add_connection,
    add_node,
    networks,
    reached,
    sizes,
)
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


ROOM = 12


def first(*weights: float) -> np.ndarray:
    """A network of two inputs, bias and one output (nodes 0 to 3)."""
    return ENDS.first(np.array(weights), ROOM)


def grown(seed: int, steps: int = 30) -> np.ndarray:
    """A network after many additions."""
    rng, marks = np.random.default_rng(seed), Marks.of(ENDS)
    genome = ENDS.first(rng.uniform(-1, 1, 3), 40)
    for _ in range(steps):
        marks.new_generation()
        add_node(genome, marks, rng)
        add_connection(genome, marks, ENDS, 1.0, rng)
    return genome


def by_hand(genome: np.ndarray, inputs: np.ndarray) -> float:
    """The output, node by node, as the definition has it."""
    on = genome[genome[:, ENABLED] > 0]

    def value(node: int) -> float:
        if node < 3:
            return float([*inputs, 1.0][node])
        total = sum(g[WEIGHT] * value(int(g[SOURCE])) for g in on if g[TARGET] == node)
        return float(1 / (1 + np.exp(-SLOPE * total)))

    return value(3)


class TestTopology:
    @pytest.mark.parametrize("seed", range(5))
    def test_any_topology_says_what_its_nodes_do_one_after_another(self, seed):
        genes = np.stack([grown(seed), grown(seed + 90, 3)])
        for genome, said in zip(genes, answers(genes), strict=True):
            for inputs, one in zip(((0, 0), (0, 1), (1, 0), (1, 1)), said, strict=True):
                assert one == pytest.approx(by_hand(genome, np.array(inputs)), abs=1e-6)

    def test_it_feeds_forward_only(self):
        genome = grown(3)
        pairs = genome[genome[:, INNOVATION] > 0][:, [SOURCE, TARGET]].astype(int)
        for source, target in pairs.tolist():
            assert source not in reached(target, pairs.tolist())

    def test_a_network_without_hidden_nodes_is_applied_at_once(self):
        inner, outer, passes = networks(first(1, 2, 3)[None], ENDS)
        assert passes == 0
        assert inner.shape == (1, 1, 1)
        assert outer[0, 0].tolist() == [1, 2, 3]


class TestGrowth:
    def test_a_split_keeps_the_way_and_its_weight(self):
        genome, marks = first(0.5, 0.5, 0.5), Marks.of(ENDS)
        add_node(genome, marks, np.random.default_rng(0))
        split = int(np.flatnonzero(genome[:3, ENABLED] == 0)[0])
        assert genome[3].tolist() == [4, split, 4, 1, 1]
        assert genome[4].tolist() == [5, 4, 3, 0.5, 1]
        assert list(sizes(genome[None], ENDS)) == [(1, 4)]

    def test_the_same_invention_has_one_number_within_a_generation(self):
        marks = Marks.of(ENDS)
        assert marks.split(2) == marks.split(2) == (4, 4, 5)
        assert marks.link(0, 4) == marks.link(0, 4) == 6
        marks.new_generation()
        assert marks.split(2) == (5, 7, 8)

    def test_without_room_nothing_grows(self):
        genome = ENDS.first(np.ones(3), 3)
        before, marks = genome.copy(), Marks.of(ENDS)
        add_node(genome, marks, np.random.default_rng(0))
        add_connection(genome, marks, ENDS, 1.0, np.random.default_rng(0))
        np.testing.assert_array_equal(genome, before)


class TestSpecies:
    def test_distance_is_equation_1(self):
        one, other = first(1, 1, 1), first(2, 1, 0)
        add_node(other, Marks.of(ENDS), np.random.default_rng(0))
        found = distance(one[None], other, NeatSettings())
        assert found[0] == pytest.approx(2 * 1.0 + 0.4 * 2 / 3)

    def test_children_are_shared_out_by_mean_worth(self):
        assert shared_out(np.array([3.0, 1.0, 1.0]), 10).tolist() == [6, 2, 2]
        assert shared_out(np.array([1.0, 1.0, 1.0]), 10).sum() == 10

    def test_those_alike_share_a_species(self):
        genes = np.stack([first(0, 0, 0), first(1, 0, 0), first(90, 0, 0)])
        lineage = Lineage()
        lineage.sort(genes, NeatSettings())
        assert [each.members.tolist() for each in lineage.species] == [[0, 1], [2]]

    def test_a_stale_species_has_no_children_but_for_the_best(self):
        lineage, rule = Lineage(), NeatSettings(stale=2)
        lineage.sort(np.stack([first(0, 0, 0), first(90, 0, 0)]), rule)
        for _ in range(3):
            lineage.note(np.array([1.0, 2.0]))
        able = lineage.breeding(rule, np.array([1.0, 2.0]))
        assert [each.members.tolist() for each in able] == [[1]]


class TestBreeding:
    def test_the_better_parent_gives_the_structure(self):
        small, large = first(1, 1, 1), first(9, 9, 9)
        add_node(large, Marks.of(ENDS), np.random.default_rng(0))
        genes, rng = np.stack([small, large]), np.random.default_rng(0)
        pair = np.zeros(50, int), np.ones(50, int)
        for worth, size in (([2, 1], 3), ([1, 2], 5), ([1, 1], 3)):
            found = crossed(genes, np.array(worth), *pair, NeatSettings(), rng)
            assert ((found[..., INNOVATION] > 0).sum(1) == size).all()
            assert set(found[:, :3, WEIGHT].ravel()) == {1.0, 9.0}

    def test_champions_of_large_species_live_on(self):
        rng, rule = np.random.default_rng(0), NeatSettings()
        genes = ENDS.first(rng.uniform(-1, 1, (20, 3)), ROOM)
        worth = rng.random(20) + 0.1
        children = bred(genes, worth, Lineage(), Marks.of(ENDS), ENDS, rule, rng)
        assert (children == genes[worth.argmax()]).all((1, 2)).any()
        assert (np.abs(children[..., WEIGHT]) <= rule.limit).all()

    @pytest.mark.parametrize("seed", range(3))
    def test_it_solves_exclusive_or(self, seed):
        found = exclusive_or(RULE, seed)
        assert found is not None
        assert found[1] >= 1  # nothing without a hidden node can

    def test_weights_alone_do_not_solve_it(self):
        still = NeatSettings(add_node=0, add_connection=0, population=20)
        assert exclusive_or(still, 0) is None
