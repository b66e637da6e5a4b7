"""Breeding for one goal and for several, and numbers of a model that may be wrong."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.prior.model_learner import bred, crowding, fronts, inside, ranked
from bns.prior.modelling import Unknowns, varied

GAINS = tuple(f"wheel_gain:wheel={side},factor=0.2..1.2" for side in ("left", "right"))


def dominates(one, other):
    return (one <= other).all() and (one < other).any()


def test_nothing_in_the_first_front_is_dominated_and_all_else_by_the_one_before():
    costs = np.random.default_rng(0).integers(0, 6, (60, 3)).astype(float)
    found = fronts(costs)
    assert sorted(np.concatenate(found)) == list(range(60))
    for number, front in enumerate(found):
        left = np.concatenate(found[number:])
        assert not any(dominates(costs[a], costs[b]) for a in left for b in front)
        for row in front if number else ():
            assert any(dominates(costs[a], costs[row]) for a in found[number - 1])


def test_room_is_that_between_neighbours_and_ends_have_all_of_it():
    costs = np.array([[0.0, 4.0], [1.0, 3.0], [3.0, 1.0], [4.0, 0.0]])
    np.testing.assert_allclose(crowding(costs), [np.inf, 1.5, 1.5, np.inf])
    dominated = np.vstack([[9.0, 9.0], costs])
    assert ranked(dominated)[-1] == 0


def test_children_lie_in_the_cube_and_have_the_genes_of_the_better_ones():
    rng = np.random.default_rng(0)
    genes = np.tile(np.linspace(0, 1, 20)[:, None], (1, 30))
    children = bred(genes, 400, rng)
    assert children.shape == (400, 30) and (children >= 0).all()
    assert (children <= 1).all()
    assert np.median(children) < 0.3  # the best one is at 0
    assert len(bred(genes[:1], 3, rng)) == 3


def test_reflection_keeps_what_is_inside():
    np.testing.assert_allclose(inside(np.array([0.3, -0.2, 1.1])), [0.3, 0.2, 0.9])


class TestUnknowns:
    def test_points_are_effects_and_the_nominal_one_is_none(self):
        found = Unknowns(GAINS)
        (nominal,) = found.damages(found.nominal[None])
        assert all(event.effect.is_nominal for event in nominal.events)
        (slow,) = found.damages(np.array([[0.6, 0.8]]))
        assert slow.events[0].effect["factor"] == pytest.approx(0.8)
        assert slow.events[0].effect["wheel"] == "left"

    def test_the_planted_numbers_are_found(self):
        rng, target = np.random.default_rng(0), np.array([0.6, 0.8])
        points = Unknowns(GAINS).random(8, rng)
        misses = np.linalg.norm(points - target, axis=1)
        for _ in range(30):
            rows = rng.permutation(8)
            made = varied(points, misses, rows, rng)
            off = np.linalg.norm(made - target, axis=1)
            better = off < misses[rows]
            points[rows[better]], misses[rows[better]] = made[better], off[better]
        assert misses.min() < 0.01

    @pytest.mark.parametrize("text", ["wheel_gain:wheel=left", "x:a=2..1", "rubbish"])
    def test_a_text_without_a_range_is_refused(self, text):
        with pytest.raises(BnsError, match="no effect with a range"):
            Unknowns([text])
