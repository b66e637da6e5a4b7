"""Closed-loop light following: evolution, islands, resets, and the loop itself."""

from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import presets
from bns.draws import Draws
from bns.errors import BnsError
from bns.evolution.chromosome import Population
from bns.evolution.generation import Breeder, Rates
from bns.experiment.config import RunConfig
from bns.experiment.run import train
from bns.experiment.task_settings import LightConfig
from bns.learners.bns.adaptations import Adaptations
from bns.learners.bns.learner import Bns
from bns.learners.bns.light import islands
from bns.learners.bns.light.problem import Weights
from bns.tasks.light_controller import Controllers, GenomePolicy, LightController
from tests.bns.robots import FakeLightWorld, small_light
from tests.bns.shared import contents


class TestEvolution:
    def test_the_breeder_takes_weights(self):
        config = presets.load("khepera-light").evolution
        config = replace(config, population=8, crossover="single-point", elitism=0)
        config = replace(config, mutation_rate=0.0, headless_chicken=0.0, tournament=2)
        kind = Controllers(3, False, -0.1, 0.1, 0.0)
        weights = Weights.of(kind, torch.tensor([5.0]), 20.0)
        draws = Draws(1)
        breeder = Breeder(config, weights, True)
        # every gene of an individual is its number, so that children show their cuts
        genes = torch.arange(8.0).view(1, 8, 1, 1).expand(1, 8, kind.genes, 1).clone()
        whole = Population(genes, torch.full((1, 8), kind.genes))
        rates = Rates(torch.tensor([0.0]), torch.tensor([[0.1]]))
        children = breeder.breed(
            whole, torch.rand(1, 8), rates, breeder.draw(draws, rates)
        )
        for child in children.genes[0, :, :, 0]:
            assert (child.diff() != 0).sum() <= 1  # one cut, at the same place

    def test_ring_sends_the_best_to_the_next_island(self):
        genes = torch.arange(12.0).view(4, 3, 1, 1)  # two runs of two islands
        cost = torch.tensor([[3.0, 1, 2]] * 4)
        config = LightConfig(islands=2, replaced="worst")
        population = Population(genes.clone(), torch.ones(4, 3).long())
        moved = islands.migrate(population, cost, config, Draws(0)).genes[..., 0, 0]
        assert moved.tolist() == [[4, 1, 2], [1, 4, 5], [10, 7, 8], [7, 10, 11]]

    @pytest.mark.parametrize("topology", ["ring", "random"])
    @pytest.mark.parametrize("migrant", ["best", "tournament", "random"])
    def test_migrants_stay_within_the_run_and_spare_the_best(self, topology, migrant):
        rows = torch.arange(6.0).view(6, 1, 1, 1).expand(6, 5, 2, 1).clone()
        cost = Draws(3).uniform(6, 5)
        config = LightConfig(islands=3, migrants=2, topology=topology, migrant=migrant)
        population = Population(rows, torch.ones(6, 5).long())
        moved = islands.migrate(population, cost, config, Draws(1)).genes[..., 0, 0]
        for row in range(6):
            other = moved[row][moved[row] != row]
            assert len(other) == 2
            assert ((other // 3) == row // 3).all()
            assert moved[row, cost[row].argmin()] == row

    def test_reset_keeps_as_many_as_asked_for(self):
        configs = [small_light(reset_every=1, reset_elitists=n) for n in (0, 3)]
        learner = Bns(configs, replicates=[0, 0], onsets=[-1, -1])
        before = learner.population.genes.clone()
        learner._reset(1)
        same = (learner.population.genes[:, :, None] == before[:, None]).all(-1).all(-1)
        assert same.any(2).sum(1).tolist() == [0, 3]

    def test_the_worst_islands_start_anew_and_the_others_do_not(self):
        config = small_light(islands=4, renewed=3)
        learner = Bns([config] * 2, replicates=[0, 1], onsets=[-1, -1])
        before = learner.population.genes.clone()
        size = before.shape[1]
        cost = torch.arange(8.0)[:, None].expand(8, size).clone()
        cost[5, 0] = -1.0  # an island counts by its best: of run 1 it is the second
        state = learner.memories, learner.population
        after, _ = learner.problem.settle(1, *state, cost)
        kept = (after.genes == before).flatten(1).all(1)
        assert kept.tolist() == [True, *[False] * 4, True, False, False]

    def test_weights_stay_within_their_limit(self):
        config = small_light(weight_limit=12.0)
        learner = Bns([config], replicates=[0], onsets=[-1])
        for trial in (1, 2):
            learner.propose(trial)  # SBX would spread them beyond it
        assert learner.population.genes.abs().max() == 12.0


class TestLoop:
    def test_it_learns_to_come_closer(self):
        config = small_light()
        evolution = replace(config.evolution, population=60, generations=8)
        snn = replace(config.snn, epochs=60)
        light = replace(config.light, starts=4, cycles=40)
        config = replace(config, evolution=evolution, snn=snn, light=light, trials=6)
        record = train(config, world=FakeLightWorld())
        # driving at the lamp takes away more than half of what standing costs
        assert record["fitness"][:, -3:].mean() < 0.6 * record["fitness"][:, 0].mean()
        assert record["sensor_left"][:, -1].mean() < record["sensor_left"][:, 0].mean()
        assert record.extra["readings"].shape == (2, 6, 41, 2)

    @pytest.mark.parametrize(
        "light", [{}, {"islands": 2, "migration_every": 1, "renewed": 1}]
    )
    def test_a_run_that_was_stopped_resumes_to_the_same_bytes(self, tmp_path, light):
        config = small_light(**light)
        train(config, tmp_path / "whole", world=FakeLightWorld())
        asked = iter([False, True])
        part = {"world": FakeLightWorld(), "resume": True}
        train(config, tmp_path / "part", stop=lambda: next(asked), **part)
        train(config, tmp_path / "part", **part)
        whole, resumed = contents(tmp_path / "whole"), contents(tmp_path / "part")
        assert whole == resumed

    def test_runs_of_a_batch_keep_their_own_settings(self):
        configs = [small_light(mirror=True), small_light(mirror=False, weights=1.0)]
        learner = Bns(configs, replicates=[0, 0], onsets=[-1, -1])
        reach = learner.population.genes.abs().amax((1, 2, 3))
        assert reach[0] > 9
        assert reach[1] <= 1
        proposal = learner.propose(0)
        policy = GenomePolicy.of(proposal.tried)
        tried = FakeLightWorld().drive(policy, cycles=20, seeds=[1, 2])
        row = learner.observe(0, tried, None)
        assert row["patterns"].tolist() == [40, 20]
        assert row["sensor_patterns"].tolist() == [42, 21]

    def test_a_batch_is_drawn_from_all_patterns_of_a_run(self):
        learner = Bns(
            [small_light(batch=32, mirror=False), small_light(batch=32)],
            replicates=[0, 0],
            onsets=[-1, -1],
        )
        policy = GenomePolicy.of(learner.propose(0).tried)
        tried = FakeLightWorld().drive(policy, cycles=20, seeds=[1, 2])
        learner.observe(0, tried, None)
        drawn = learner.memories[0]._patterns()
        assert drawn.weight.sum((1, 2, 3)).tolist() == [20, 32]  # of 20 and of 40
        kept = {tuple(row) for row in learner.memories[0].buffer.targets[1].tolist()}
        assert {tuple(row) for row in drawn.targets[1].T.tolist()} <= kept
        whole = learner.memories[0].buffer.targets[0]
        np.testing.assert_array_equal(drawn.targets[0].T[:20].numpy(), whole)

    def test_settings_that_cannot_differ(self):
        with pytest.raises(BnsError, match="light following may differ"):
            Bns(
                [small_light(), small_light(hidden=7)],
                replicates=[0, 1],
                onsets=[-1, -1],
            )
        with pytest.raises(BnsError, match="multiple"):
            Bns([small_light(islands=5)], replicates=[0], onsets=[-1])
        with pytest.raises(BnsError, match="nothing would be learned"):
            Bns([small_light(renewed=1)], replicates=[0], onsets=[-1])

    def test_foreseen_and_measured_agree_where_the_snns_are_right(self):
        """A robot that was seen to stand still is foreseen where it stands."""
        config = small_light()
        stops = replace(config.controller, speed_low=5000.0)
        config = replace(config, controller=stops)
        learner = Bns([config], replicates=[0], onsets=[-1])
        genes = torch.zeros_like(learner._chosen.genes)
        genes[0, 0, -2:] = -3.0  # both wheels below the dead band
        learner._chosen = learner._chosen._replace(genes=genes)
        kind = learner.problem.simulator.controllers
        attempt = LightController(kind, genes[0, 0, :, 0], 20, 0.4)
        tried = FakeLightWorld().drive(GenomePolicy.of([attempt]), cycles=20, seeds=[1])
        assert not tried[0].commands.values.any()
        for trial in range(6):
            row = learner.observe(trial, tried, None)
        seen = learner.task.measured(tried)
        np.testing.assert_allclose(row["predicted"], seen["poses"], atol=0.05)
        assert row["fitness_predicted"] == pytest.approx(seen["fitness"], rel=0.1)


def test_windows_and_magnitudes_follow_the_adaptations():
    config = replace(
        small_light(),
        adaptation=replace(RunConfig().adaptation, mutation_magnitude_after=0.3),
    )
    learner = Bns([config], replicates=[0], onsets=[1])
    assert isinstance(learner.adaptations, Adaptations)
    assert learner.problem.rates(1).magnitude.tolist() == [[pytest.approx(0.05)]]
    assert learner.problem.rates(2).magnitude.tolist() == [[pytest.approx(0.3)]]


class TestDisagreement:
    def learner(self, **light):
        config = small_light(**light)
        config = replace(config, choose="disagreement")
        config = replace(config, snn=replace(config.snn, kind="ensemble", members=4))
        return Bns([config] * 2, replicates=[0, 1], onsets=[-1, -1])

    def test_is_the_variance_over_members_summed_over_cycles(self):
        learner = self.learner()
        for learned, shape in (
            (learner.memories[0], learner.problem.simulator.motion),
            (learner.memories[1], learner.problem.simulator.sensors),
        ):
            learned.theta.zero_()  # every member says its last bias
            learned.theta[1, -shape.outputs] = 0.2  # of the last member of run 1
        genomes = learner.population.genes.reshape(2, 12, -1, 1)
        whole = Population(genomes, torch.zeros(2, 12).long())
        found = learner.problem.disagreement(learner.memories, whole)
        each = 0.2**2 * (1 / 4 - 1 / 16)  # of a member of four that is off by 0.2
        assert found[0].tolist() == [0.0] * 12
        assert found[1].tolist() == pytest.approx([20 * 2 * each] * 12)

    def test_what_is_tried_need_not_be_the_best(self):
        record = train(self.learner(islands=2).config, world=FakeLightWorld())
        assert (record["fitness_best"] != record["fitness"]).any()

    def test_needs_an_ensemble(self):
        config = replace(small_light(), choose="disagreement")
        learner = Bns([config], replicates=[0], onsets=[-1])
        with pytest.raises(BnsError, match="needs an ensemble"):
            learner.propose(0)
