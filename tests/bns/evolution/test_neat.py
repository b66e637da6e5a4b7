"""NEAT: known answers of its parts, and exclusive or."""

import numpy as np
import pytest

from bench.rivals.networks import ENDS, RULE, answers, exclusive_or
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


class TestNetworks:
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
