"""Equivalence and looks with the level spent over them, against known answers."""

import numpy as np
import pytest

from bns import stats
from bns.errors import BnsError
from bns.stats.equivalence import MARGIN, equivalence, of_share
from bns.stats.sequential import Design, up_to


def test_equivalence_by_hand():
    # Newcombe's error of A12 at 0.64, 100 runs a side: variance of one pair times
    # 1 + 99 (0.36 / 1.36 + 0.64 / 1.64), over 10,000 pairs
    error = np.sqrt(0.64 * 0.36 * (1 + 99 * (0.36 / 1.36 + 0.64 / 1.64)) / 1e4)
    assert stats.a12_error(0.64, 100, 100) == pytest.approx(error)
    z = 0.04 / error
    assert of_share(0.60, 100, 100) == pytest.approx(0.1519, abs=5e-4)
    assert z == pytest.approx(1.028, abs=1e-3)
    assert of_share(0.5 + MARGIN, 100, 100) == pytest.approx(0.5)


@pytest.mark.parametrize("share", [0.40, 0.47, 0.5, 0.56, 0.58, 0.6])
def test_equivalent_is_where_the_90_percent_interval_lies_inside(share):
    runs = 100
    # two samples of that A12, without ties: b steps over so many values of a
    a = np.arange(runs, dtype=float)
    b = np.full(runs, (1 - share) * runs) - 0.5 + np.arange(runs) * 1e-6
    limits = stats.a12(a, b, confidence=0.9)
    assert limits.value == pytest.approx(share, abs=0.006)
    inside = limits.low > 0.5 - MARGIN and limits.high < 0.5 + MARGIN
    assert (equivalence(a, b) < 0.05) == inside


def test_thirty_runs_hardly_ever_show_that_sides_are_alike():
    assert of_share(0.50, 30, 30) < 0.05 < of_share(0.53, 30, 30)
    assert of_share(0.56, 100, 100) < 0.05


def test_all_ties_are_alike_and_margins_have_bounds():
    never = np.full(100, np.inf)
    assert equivalence(never, never) < 0.001
    for margin in (0, 0.5, -1):
        with pytest.raises(BnsError, match="margin"):
            equivalence(never, never, margin=margin)


def test_the_level_is_spent_in_proportion_to_runs():
    assert Design().shares == pytest.approx((0.1, 0.1, 0.1, 0.2, 0.5))
    assert sum(up_to(30).shares) == pytest.approx(1)
    assert up_to(35).looks == (10, 20, 30, 35)


def test_the_p_of_looks_by_hand():
    design = Design()
    assert design.p([0.004]) == pytest.approx(0.04)
    assert design.p([0.004, 0.5]) == pytest.approx(0.04)  # what was found stays found
    assert design.p([0.5, 0.5, 0.5, 0.5, 0.02]) == pytest.approx(0.04)
    assert design.p([0.5]) == 1.0


def test_looks_made_are_those_with_enough_runs():
    design = Design()
    assert design.made(35) == (10, 20, 30)
    assert design.made(100) == design.looks == design.made(400)
    assert design.made(4) == (4,)


@pytest.mark.parametrize("looks", [(), (10, 10), (20, 10), (0, 10)])
def test_looks_have_to_grow(looks):
    with pytest.raises(BnsError, match="grow"):
        Design(looks)


def test_looking_often_finds_no_more_than_the_level_where_nothing_is():
    rng = np.random.default_rng(0)
    design, found, many = Design(), 0, 400
    for _ in range(many):
        a, b = rng.normal(size=(2, 100))
        seen = [stats.mann_whitney(a[:n], b[:n]) for n in design.looks]
        found += design.p(seen) < 0.05
    assert found / many < 0.05 + 2 * np.sqrt(0.05 * 0.95 / many)
    assert found / many > 0.01  # it does find some
