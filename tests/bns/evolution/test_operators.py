"""Operators of the evolutionary algorithm against their definitions."""

import math
from dataclasses import replace

import numpy as np
import pytest
import torch

from bns import models
from bns.draws import Draws
from bns.errors import UnknownNameError
from bns.evolution import generation, selection, variation
from bns.evolution.chromosome import Encoding, Population
from bns.evolution.generation import Breeder, Rates
from bns.evolution.goals import COINS, TICK, GoalBreeder, Goals, reaches, repeated
from bns.experiment.task_settings import ControllerConfig
from bns.learners.bns.config import EvolutionConfig
from bns.learners.bns.learner import Bns
from tests.bns.robots import small

COSTS = torch.tensor([[4.0, 1.0, 3.0, 2.0]])


def population(*lists: list[float], longest: int = 6) -> Population:
    """One run whose genes all equal a mark, so that origins can be read."""
    genes = torch.zeros(1, len(lists), longest, 3)
    for index, marks in enumerate(lists):
        genes[0, index, : len(marks)] = torch.tensor(marks)[:, None]
    return Population(genes, torch.tensor([[len(marks) for marks in lists]]))


def marks(child: Population, index: int = 0) -> list[float]:
    return child.genes[0, index, : child.lengths[0, index], 0].tolist()


def test_tournament_takes_the_best_of_the_drawn():
    coins = torch.tensor([[[0.0, 0.6], [0.9, 0.9], [0.3, 0.99]]])
    assert selection.tournament(COSTS, coins).tolist() == [[2, 3, 1]]


@pytest.mark.parametrize("size", [1, 2, 20])
def test_winners_drawn_by_rank_are_as_likely_as_by_drawing_entrants(size):
    draws, cost = Draws(3), Draws(1).uniform(2, 30)
    entrants = selection.tournament(cost, draws.uniform(2, 20_000, size))
    ranked = selection.tournament_by_rank(cost, draws.uniform(2, 20_000), size)
    for run in range(2):
        counts = [
            torch.bincount(x[run], minlength=30) / 20_000 for x in (entrants, ranked)
        ]
        torch.testing.assert_close(*counts, atol=0.015, rtol=0)


def test_tournament_pressure_is_that_of_the_definition():
    cost = torch.arange(10.0)[None]
    coins = Draws(1).uniform(1, 40_000, 3)
    share = (selection.tournament(cost, coins) == 0).float().mean().item()
    assert share == pytest.approx(1 - 0.9**3, abs=0.01)


def test_best_and_random():
    coins = torch.tensor([[[0.0], [0.5], [0.99]]])
    assert selection.best(COSTS, coins).tolist() == [[1, 1, 1]]
    assert selection.random(COSTS, coins).tolist() == [[0, 2, 3]]


def test_roulette_is_proportional_and_never_takes_the_worst():
    picked = selection.roulette(COSTS, Draws(2).uniform(1, 60_000, 1))[0]
    shares = torch.bincount(picked, minlength=4) / 60_000
    assert shares.tolist() == pytest.approx([0, 3 / 6, 1 / 6, 2 / 6], abs=0.01)


def test_roulette_of_equals_is_uniform():
    picked = selection.roulette(torch.ones(1, 4), Draws(3).uniform(1, 40_000, 1))[0]
    shares = torch.bincount(picked, minlength=4) / 40_000
    assert shares.tolist() == pytest.approx([0.25] * 4, abs=0.01)


def test_unknown_operators_are_refused_with_a_suggestion():
    with pytest.raises(UnknownNameError, match="Did you mean 'tournament'"):
        selection.select("turnament", COSTS, torch.zeros(1, 1, 1))
    with pytest.raises(UnknownNameError, match="Available: n-point"):
        variation.coins_needed("two", 1, (1, 1, 6, 3))


def test_single_point_cuts_both_lists_independently():
    first, second = population([1, 2, 3, 4]), population([7, 8])
    child = variation.n_point(
        first, second, torch.tensor([[[3]]]), torch.tensor([[[1]]])
    )
    assert marks(child) == [1, 2, 3, 8]


def test_two_points_come_back_to_the_first_parent():
    first, second = population([1, 2, 3, 4]), population([7, 8, 9])
    child = variation.n_point(
        first, second, torch.tensor([[[1, 3]]]), torch.tensor([[[0, 2]]])
    )
    assert marks(child) == [1, 7, 8, 4]


def test_crossover_keeps_the_longest_list_and_never_makes_an_empty_one():
    first, second = population([1, 2, 3, 4, 5]), population([6, 7, 8, 9])
    long = variation.n_point(
        first, second, torch.tensor([[[5]]]), torch.tensor([[[0]]])
    )
    assert marks(long) == [1, 2, 3, 4, 5, 6]
    none = variation.n_point(
        first, second, torch.tensor([[[0]]]), torch.tensor([[[4]]])
    )
    assert marks(none) == [1, 2, 3, 4, 5]


def test_fixed_length_stays():
    first, second = population([1, 2, 3, 4, 5, 6]), population([11, 12, 13, 14, 15, 16])
    coins = torch.tensor([[[0.5, 0.0]]])
    child = variation.cross("single-point", first, second, coins, fixed_length=True)
    assert marks(child) == [1, 2, 3, 14, 15, 16]


def test_uniform_crossover_swaps_where_both_have_genes():
    first, second = population([1, 2, 3]), population([7, 8])
    coins = torch.full((1, 1, 6, 3), 0.9)
    coins[0, 0, 1:] = 0.1
    assert marks(variation.uniform(first, second, coins)) == [1, 8, 3]


@pytest.mark.parametrize(("v", "spread"), [(0.125, 0.5), (0.5, 1.0), (0.875, 2.0)])
def test_simulated_binary_follows_equation_2_17(v, spread):
    first, second = population([1.0]), population([3.0])
    child = variation.simulated_binary(
        first, second, torch.full((1, 1, 6, 3), v), eta=1.0
    )
    expected = 0.5 * ((1 + spread) * 1.0 + (1 - spread) * 3.0)
    assert marks(child) == pytest.approx([expected])


LOW, HIGH = torch.tensor([0.0, 0, 0]), torch.tensor([1.0, 1, 1])


def mutated(kind: str, rate: float, size: float, start: float = 0.5) -> torch.Tensor:
    genes = torch.full((1, 2000, 10, 3), start)
    coins = Draws(4).uniform(*genes.shape)
    rates = torch.tensor([rate]), torch.tensor([[size] * 3])
    return variation.mutate(kind, genes, coins, *rates, LOW, HIGH)


@pytest.mark.parametrize("kind", ["bounded-uniform", "uniform-range", "gaussian"])
def test_mutation_rate_and_bounds(kind):
    after = mutated(kind, 0.2, 0.1)
    assert (after != 0.5).float().mean().item() == pytest.approx(0.2, abs=0.01)
    assert after.min() >= 0 and after.max() <= 1


def test_bounded_uniform_is_uniform_within_the_magnitude():
    change = mutated("bounded-uniform", 1.0, 0.1) - 0.5
    assert change.abs().max() <= 0.1001
    assert change.std().item() == pytest.approx(0.1 / 3**0.5, rel=0.02)


def test_gaussian_has_the_magnitude_as_deviation():
    change = mutated("gaussian", 1.0, 0.05) - 0.5
    assert change.std().item() == pytest.approx(0.05, rel=0.02)
    assert change.mean().item() == pytest.approx(0.0, abs=0.001)


def test_uniform_range_goes_uniformly_to_either_bound():
    after = mutated("uniform-range", 1.0, 0.0, start=0.25)
    up = after > 0.25
    assert up.float().mean().item() == pytest.approx(0.5, abs=0.01)
    assert after[up].mean().item() == pytest.approx(0.625, abs=0.01)
    assert after[~up].mean().item() == pytest.approx(0.125, abs=0.01)


def test_diversity_of_a_known_population():
    low, high = torch.zeros(3), torch.ones(3)
    encoding = Encoding(low, high, 0.0, 6, (1, 6))
    found = generation.measures(population([0.2, 0.4], [0.6]), encoding)
    assert found["diversity_41"].item() == pytest.approx(3 * 0.4)
    assert found["diversity_51"].item() == pytest.approx(3 * 2 * 0.2**2)
    assert found["diversity_73"].exp().item() == pytest.approx(3 * 0.4)


def breeder(**settings) -> tuple[Breeder, Rates]:
    config = EvolutionConfig(population=60, **settings)
    encoding = Encoding.of(ControllerConfig(max_commands=6, initial_max=6))
    rates = Rates(torch.tensor([0.2]), torch.tensor([[0.01, 0.01, 0.2]]))
    return Breeder(config, encoding, False), rates


def test_elites_survive_unchanged():
    made, rates = breeder(elitism=2, mutation_rate=1.0)
    draws = Draws(5)
    before = made.encoding.random(1, 60, draws)
    cost = Draws(6).uniform(1, 60)
    after = made.breed(before, cost, rates, made.draw(draws, rates))
    best = cost.argsort(1)[0, :2]
    assert torch.equal(after.genes[0, :2], before.genes[0, best])
    assert torch.equal(after.lengths[0, :2], before.lengths[0, best])
    assert after.lengths.shape == (1, 60)


def test_headless_chicken_brings_fresh_genes():
    made, rates = breeder(headless_chicken=1.0, mutation_rate=0.1, elitism=0)
    draws = Draws(7)
    same = made.encoding.random(1, 1, draws)
    before = Population(same.genes.expand(1, 60, 6, 3), same.lengths.expand(1, 60))
    still = Rates(torch.tensor([1e-9]), rates.magnitude)
    with_chicken = made.breed(before, torch.ones(1, 60), still, made.draw(draws, still))
    without, _ = breeder(headless_chicken=0.0, elitism=0)
    plain = without.breed(before, torch.ones(1, 60), still, without.draw(draws, still))
    known = {0.0, *same.genes.flatten().tolist()}
    assert set(plain.genes.flatten().tolist()) <= known
    assert len(set(with_chicken.genes.flatten().tolist()) - known) > 50


@pytest.mark.parametrize("kind", ["single-point", "n-point", "uniform", "sbx"])
def test_evolution_reaches_a_known_optimum(kind):
    """The optimum: one command of the highest speeds and the shortest duration."""
    made, rates = breeder(crossover=kind, headless_chicken=0.1)
    draws = Draws(8)
    low, high = made.encoding.low, made.encoding.high
    best = torch.stack([high[0], high[1], low[2]])

    def cost(p: Population) -> torch.Tensor:
        off = ((p.genes - best) / (high - low)).abs().sum(-1)
        return (off * p.valid).sum(-1)

    now = made.encoding.random(1, 60, draws)
    if kind in ("uniform", "sbx"):  # they never change a length
        now = now._replace(lengths=torch.ones_like(now.lengths))
    for _ in range(60):
        now = made.breed(now, cost(now), rates, made.draw(draws, rates))
    assert cost(now).min().item() < 0.05


@pytest.mark.parametrize("kind", ["single-point", "n-point", "uniform", "sbx"])
def test_children_stay_within_bounds(kind):
    made, rates = breeder(crossover=kind)
    draws = Draws(9)
    now = made.encoding.random(1, 60, draws)
    for _ in range(5):
        now = made.breed(now, torch.zeros(1, 60), rates, made.draw(draws, rates))
    genes = now.genes[now.valid]
    assert (genes >= made.encoding.low).all() and (genes <= made.encoding.high).all()


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

    def test_coxae_may_reach_farther_than_other_joints(self):
        walk = replace(small().walk, reach=0.6, coxa_reach=0.9)
        goals = Goals.of(small(walk=walk))
        coxae = [channel.name.endswith("_coxa") for channel in goals.channels]
        for grown, farthest in ((0.0, 0.6), (0.5, 0.75), (1.0, 0.9)):
            found = reaches(walk, goals.channels, grown)
            np.testing.assert_allclose(found, np.where(coxae, farthest, 0.6))
        assert goals.high.max() == pytest.approx(0.9)
        assert (goals.high[~torch.tensor(coxae)] <= 0.6).all()
        smaller = reaches(replace(walk, coxa_reach=0.3), goals.channels)
        assert (smaller == 0.6).all()

    def test_a_reach_that_grows_holds_children_back(self):
        walk = replace(small().walk, reach=0.5, coxa_reach=0.9)
        goals, draws = Goals.of(small(walk=walk)), Draws(0)
        breeder = GoalBreeder(small().evolution, goals, True)
        population = goals.random(1, 40, draws)
        edge = torch.where(population.genes > 0, goals.high, goals.low)
        reach = torch.full((18,), 0.55)
        rates = Rates(torch.tensor([0.5]), torch.full((1, 18), 0.3), reach=reach)
        coins = breeder.draw(draws, rates)
        told = population._replace(genes=edge), draws.uniform(1, 40), rates, coins
        assert breeder.breed(*told).genes.abs().max() <= 0.55


class TestRepetition:
    """Commands numbered 0 to 7, so that children show what was put where."""

    @staticmethod
    def child(*coins, chance=0.5):
        genes = torch.arange(8.0).view(1, 1, 8, 1).expand(1, 1, 8, 2)
        told = repeated(genes, torch.tensor([[coins]]), torch.tensor([chance]))
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
        coins = draws.uniform(1, 4000, COINS)
        never, seldom = torch.tensor([0.0]), torch.tensor([0.1])
        assert torch.equal(repeated(genes, coins, never), genes)
        changed = (repeated(genes, coins, seldom) != genes).any(-1).any(-1)
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
