"""Operators of the evolutionary algorithm against their definitions."""

import pytest
import torch

from bns.draws import Draws
from bns.errors import UnknownNameError
from bns.evolution import crossover, diversity, mutation, selection
from bns.evolution.chromosome import Encoding, Population
from bns.evolution.generation import Breeder, Rates
from bns.experiment.config import ControllerConfig, EvolutionConfig

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
        crossover.coins_needed("two", 1, (1, 1, 6, 3))


def test_single_point_cuts_both_lists_independently():
    first, second = population([1, 2, 3, 4]), population([7, 8])
    child = crossover.n_point(
        first, second, torch.tensor([[[3]]]), torch.tensor([[[1]]])
    )
    assert marks(child) == [1, 2, 3, 8]


def test_two_points_come_back_to_the_first_parent():
    first, second = population([1, 2, 3, 4]), population([7, 8, 9])
    child = crossover.n_point(
        first, second, torch.tensor([[[1, 3]]]), torch.tensor([[[0, 2]]])
    )
    assert marks(child) == [1, 7, 8, 4]


def test_crossover_keeps_the_longest_list_and_never_makes_an_empty_one():
    first, second = population([1, 2, 3, 4, 5]), population([6, 7, 8, 9])
    long = crossover.n_point(
        first, second, torch.tensor([[[5]]]), torch.tensor([[[0]]])
    )
    assert marks(long) == [1, 2, 3, 4, 5, 6]
    none = crossover.n_point(
        first, second, torch.tensor([[[0]]]), torch.tensor([[[4]]])
    )
    assert marks(none) == [1, 2, 3, 4, 5]


def test_fixed_length_stays():
    first, second = population([1, 2, 3, 4, 5, 6]), population([11, 12, 13, 14, 15, 16])
    coins = torch.tensor([[[0.5, 0.0]]])
    child = crossover.cross("single-point", first, second, coins, fixed_length=True)
    assert marks(child) == [1, 2, 3, 14, 15, 16]


def test_uniform_crossover_swaps_where_both_have_genes():
    first, second = population([1, 2, 3]), population([7, 8])
    coins = torch.full((1, 1, 6, 3), 0.9)
    coins[0, 0, 1:] = 0.1
    assert marks(crossover.uniform(first, second, coins)) == [1, 8, 3]


@pytest.mark.parametrize(("v", "spread"), [(0.125, 0.5), (0.5, 1.0), (0.875, 2.0)])
def test_simulated_binary_follows_equation_2_17(v, spread):
    first, second = population([1.0]), population([3.0])
    child = crossover.simulated_binary(
        first, second, torch.full((1, 1, 6, 3), v), eta=1.0
    )
    expected = 0.5 * ((1 + spread) * 1.0 + (1 - spread) * 3.0)
    assert marks(child) == pytest.approx([expected])


LOW, HIGH = torch.tensor([0.0, 0, 0]), torch.tensor([1.0, 1, 1])


def mutated(kind: str, rate: float, size: float, start: float = 0.5) -> torch.Tensor:
    genes = torch.full((1, 2000, 10, 3), start)
    coins = Draws(4).uniform(*genes.shape)
    rates = torch.tensor([rate]), torch.tensor([[size] * 3])
    return mutation.mutate(kind, genes, coins, *rates, LOW, HIGH)


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
    found = diversity.measures(population([0.2, 0.4], [0.6]), encoding)
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
