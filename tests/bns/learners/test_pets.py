"""The improved cross-entropy method: known optima, and what each part is for."""

from dataclasses import replace

import pytest
import torch

from bns.draws import Draws
from bns.evolution.chromosome import Encoding, Population
from bns.learners.pets import Icem, best, fitted, sampled
from bns.learners.pets import Normal as Distribution

GENES = Encoding(
    low=torch.tensor([-1.0, -1.0, 0.0]),
    high=torch.tensor([1.0, 3.0, 2.0]),
    dead_band=0.0,
    max_commands=5,
    initial=(1, 5),
)
GOAL = torch.tensor([0.5, -0.25, 1.5])
USUAL = Icem(
    population=250,
    iterations=40,
    decay=1.05,
    elites=30,
    kept=0.3,
    momentum=0.1,
    spread=0.25,
    fixed_length=False,
)


def off(population, goal=GOAL):
    """Lists of three commands, each at `goal`, cost nothing."""
    apart = (population.genes - goal).square().sum(3)
    apart = torch.where(population.valid, apart, 0.0).sum(2)
    return apart + (population.lengths - 3.0).square()


def start(runs=3, seed=1):
    draws = Draws(seed)
    return GENES.random(runs, USUAL.elites, draws), draws


class Counted:
    """A cost, how often it was asked, and the least that it gave."""

    def __init__(self):
        self.count, self.least = 0, []

    def __call__(self, population):
        self.count += population.lengths.shape[1]
        cost = off(population)
        self.least.append(cost.min(1).values)
        return cost


def test_a_known_optimum_is_reached_with_its_length():
    begin, draws = start(runs=50)
    elites, cost = USUAL.search(begin, off, GENES, draws)
    there = cost[:, 0] < 1e-3
    assert there.float().mean() >= 0.8  # lengths may settle too soon
    assert (elites.lengths[there, 0] == 3).all()
    found = elites.genes[there, 0]
    torch.testing.assert_close(
        found[:, :3], GOAL.expand_as(found[:, :3]), atol=0.05, rtol=0
    )
    assert not found[:, 3:].any()


def test_far_better_than_random_individuals_of_the_same_number():
    begin, draws = start()
    asked = Counted()
    _, cost = USUAL.search(begin, asked, GENES, draws)
    assert asked.count == USUAL.elites + sum(USUAL.sizes) + 1
    luck = off(GENES.random(3, asked.count, draws)).min(1).values
    assert (cost[:, 0] < 0.05 * luck).all()


def test_an_optimum_at_the_edge_is_reached_and_none_lies_beyond():
    goal = torch.tensor([1.5, -1.5, 2.0])
    whole, draws = replace(GENES, initial=(5, 5)), Draws(1)
    begin, fixed = whole.random(3, 30, draws), replace(USUAL, fixed_length=True)
    elites, cost = fixed.search(begin, lambda p: off(p, goal), whole, draws)
    known = 5 * 0.5 + 2**2  # five commands at the edge, two too many
    assert (cost[:, 0] >= known - 1e-4).all() and (cost[:, 0] < 1.02 * known).all()
    assert (elites.genes >= GENES.low).logical_or(elites.genes == 0).all()
    assert (elites.genes <= GENES.high).all()


def test_the_best_ever_is_kept_and_given_back_first():
    begin, draws = start()
    asked = Counted()
    elites, cost = replace(USUAL, kept=0.0).search(begin, asked, GENES, draws)
    least = torch.stack(asked.least).min(0).values
    torch.testing.assert_close(cost[:, 0], least)
    torch.testing.assert_close(off(elites), cost)
    assert (cost.diff(dim=1) >= 0).all()


def test_what_the_search_before_found_is_not_lost():
    begin, draws = start()
    elites, before = USUAL.search(begin, off, GENES, draws)
    short = replace(USUAL, iterations=1, population=60)
    _, after = short.search(elites, off, GENES, draws)
    assert (after[:, 0] <= before[:, 0]).all()


def test_samples_shrink_but_never_below_two_for_each_elite():
    sizes = USUAL.sizes
    assert sizes[0] == 250 and sizes[1] == round(250 / 1.05)
    assert sizes == sorted(sizes, reverse=True) and sizes[-1] == 60


def test_a_place_is_fitted_to_those_that_have_it():
    genes = torch.zeros(1, 2, 5, 3)
    genes[0, 0, :2], genes[0, 1, :1] = torch.tensor([0.0, 1.0, 1.0]), GENES.high
    both = Population(genes, torch.tensor([[2, 1]]))
    old = Distribution(
        torch.full((1, 5, 3), 0.5),
        torch.full((1, 5, 3), 0.3),
        torch.zeros(1),
        torch.zeros(1),
    )
    found = fitted(both, GENES, old)
    torch.testing.assert_close(found.mean[0, 0], torch.full((3,), 0.75))
    torch.testing.assert_close(found.spread[0, 0], torch.full((3,), 0.25))
    torch.testing.assert_close(found.mean[0, 1], torch.full((3,), 0.5))
    assert not found.spread[0, 1].any()
    torch.testing.assert_close(found.mean[0, 2:], old.mean[0, 2:])
    torch.testing.assert_close(found.spread[0, 2:], old.spread[0, 2:])
    assert found.length[0] == 1.5 and found.length_spread[0] == 0.5


def test_lists_of_one_length_stay_of_it():
    whole = replace(GENES, initial=(5, 5))
    draws = Draws(3)
    begin = whole.random(2, USUAL.elites, draws)
    fixed = replace(USUAL, fixed_length=True, iterations=3)
    elites, _ = fixed.search(begin, off, whole, draws)
    assert (elites.lengths == 5).all()


def test_a_sample_has_the_mean_and_the_spread_asked_for():
    at = Distribution(
        torch.full((1, 5, 3), 0.4),
        torch.full((1, 5, 3), 0.1),
        torch.full((1,), 4.0),
        torch.zeros(1),
    )
    drawn = sampled(at, 4000, GENES, Draws(5))
    shares = ((drawn.genes - GENES.low) / (GENES.high - GENES.low))[0, :, :4]
    assert shares.mean().item() == pytest.approx(0.4, abs=0.005)
    assert shares.std().item() == pytest.approx(0.1, abs=0.005)
    assert (drawn.lengths == 4).all() and not drawn.genes[:, :, 4].any()


def test_best_are_sorted_and_ties_keep_their_order():
    genes = torch.arange(4.0).view(1, 4, 1, 1)
    one = Population(genes, torch.ones(1, 4, dtype=torch.long))
    found, cost = best(one, torch.tensor([[2.0, 1.0, 1.0, 0.0]]), 3)
    assert found.genes.flatten().tolist() == [3, 1, 2] and cost.tolist() == [[0, 1, 1]]
