"""Chromosomes of walking robots, and how they are bred."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import models
from bns.draws import Draws
from bns.evolution import repetition
from bns.evolution.chromosome import Population
from bns.evolution.generation import Rates
from bns.evolution.goals import TICK, GoalBreeder, Goals
from bns.learners.bns.learner import Bns
from tests.bns.walkers import small


class TestGoals:
    def test_a_tick_is_what_the_maker_says(self):
        assert math.degrees(TICK) == pytest.approx(0.2933, abs=1e-4)

    def test_random_goals_lie_around_half_way_and_within_the_stops(self):
        config = small(walk=replace(small().walk, initial=1.5, reach=3.0))
        genes = Goals.of(config).random(2, 50, Draws(0)).genes
        low, high = models.robot("phantomx").ranges.T
        assert genes.shape == (2, 50, 11, 18)
        assert (genes >= torch.tensor(np.maximum(low, -1.5) - 1e-6)).all()
        assert (genes <= torch.tensor(np.minimum(high, 1.5) + 1e-6)).all()
        assert genes.amax() > 1.45 and genes.amin() < -1.45

    def test_commands_never_pass_the_stops_by_a_rounding(self):
        goals = Goals.of(small())
        genes = goals.low.expand(1, 1, 11, 18).clone()
        told = goals.commands(Population(genes, torch.full((1, 1), 11)))[0]
        assert (told.values >= models.robot("phantomx").ranges[:, 0]).all()

    def test_children_stay_within_bounds_whatever_the_crossover(self):
        config = small(walk=replace(small().walk, reach=0.5))
        goals, draws = Goals.of(config), Draws(0)
        breeder = GoalBreeder(config.evolution, goals, True)
        population = goals.random(1, 40, draws)
        edge = torch.where(population.genes > 0, goals.high, goals.low)
        population = population._replace(genes=edge)
        rates = Rates(torch.tensor([0.5]), torch.full((1, 18), 0.3))
        coins = breeder.draw(draws, rates)
        bred = breeder.breed(population, draws.uniform(1, 40), rates, coins)
        assert bred.genes.abs().max() <= 0.5
        assert (bred.genes.abs() < 0.49).any()


class TestRepetition:
    """Commands numbered 0 to 7, so that children show what was put where."""

    @staticmethod
    def child(*coins, chance=0.5):
        genes = torch.arange(8.0).view(1, 1, 8, 1).expand(1, 1, 8, 2)
        told = repetition.repeated(
            genes, torch.tensor([[coins]]), torch.tensor([chance])
        )
        assert (told[..., 0] == told[..., 1]).all()
        return told[0, 0, :, 0].tolist()

    def test_a_command_is_copied_to_another_place(self):
        found = self.child(0.4, 2 / 8, 5 / 8, 0.9, 0.0, 0.0)
        assert found == [0, 1, 2, 3, 4, 2, 6, 7]

    def test_commands_go_round_from_some_place_on(self):
        assert self.child(0.9, 0.0, 0.0, 0.4, 0.5, 0.4) == [0, 1, 2, 3, 4, 2, 3, 4]
        assert self.child(0.9, 0.0, 0.0, 0.4, 0.0, 0.99) == [0, 1, 2, 3, 0, 1, 2, 3]

    def test_what_was_copied_goes_round_with_the_others(self):
        assert self.child(0.4, 7 / 8, 1 / 8, 0.4, 0.0, 0.0) == [0, 7] * 4

    def test_none_without_a_chance_and_no_more_often_than_that(self):
        draws = Draws(2)
        genes = draws.uniform(1, 4000, 8, 3)
        coins = draws.uniform(1, 4000, repetition.COINS)
        never, seldom = torch.tensor([0.0]), torch.tensor([0.1])
        assert torch.equal(repetition.repeated(genes, coins, never), genes)
        changed = (repetition.repeated(genes, coins, seldom) != genes).any(-1).any(-1)
        # of the copies one in eight finds its own place
        assert changed.float().mean() == pytest.approx(1 - 0.9125 * 0.9, abs=0.02)

    def test_elites_are_spared_and_nothing_is_drawn_without_it(self):
        config = small()
        evolution = replace(config.evolution, elitism=3, mutation_rate=0.0)
        goals, cost = Goals.of(config), Draws(1).uniform(1, config.evolution.population)
        population = goals.random(1, config.evolution.population, Draws(0))
        best = population.genes[0, cost[0].argsort()[:3]]
        bred, after = [], []
        for repeat in (None, torch.tensor([1.0])):
            draws, breeder = Draws(5), GoalBreeder(evolution, goals, True)
            usual = Rates(torch.tensor([0.0]), torch.full((1, 18), 0.1))
            rates = usual._replace(repeat=repeat)
            coins = breeder.draw(draws, rates)
            bred.append(breeder.breed(population, cost, rates, coins).genes[0])
            after.append(draws.uniform(3))
            assert torch.equal(bred[-1][:3], best)
        assert (bred[0][3:] != bred[1][3:]).flatten(1).any(1).float().mean() > 0.9
        assert not torch.equal(*after)

    def test_only_once_damage_is_known(self):
        config = small(walk=replace(small().walk, repeat_after=0.2))
        learner = Bns([config] * 2, replicates=[0, 1], onsets=[3, -1])
        assert learner.problem.rates(3).repeat is None
        assert learner.problem.rates(4).repeat.tolist() == pytest.approx([0.2, 0.0])
        always = replace(config, walk=replace(config.walk, repeat=0.1))
        learner = Bns([always] * 2, replicates=[0, 1], onsets=[3, -1])
        assert learner.problem.rates(4).repeat.tolist() == pytest.approx([0.2, 0.1])
