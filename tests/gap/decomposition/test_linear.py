"""Known answers of the linear fit: what is planted is found, what is not is not."""

import os
import subprocess
import sys
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition import refit, shares
from bns.gap.decomposition.evidence import search
from bns.gap.decomposition.evidence.latent import Latent
from bns.gap.decomposition.evidence.linear import KAPPA, Linear
from bns.gap.decomposition.evidence.noise import (
    Memory,
    correlated,
    inflation,
    scale,
    weights,
)
from bns.gap.decomposition.evidence.spread import Spread, tail
from bns.gap.decomposition.fit import Noise, Point
from tests.sources import ROOT

NAMES = ("a", "b", "c", "d", "e", "f")
BLOCKS, EACH = 8, 60


class Rows:
    """Six rows with random columns; what a `Problem` gives a `Linear`."""

    def __init__(self, rng, alike=(), low=-10.0, high=10.0, smooth=True):
        from bns.gap.decomposition.row import Row

        self.rows = tuple(
            Row(name, 0.0, 1.0, low, high, slack=0.02 if name == "f" else 0.0,
                smooth=smooth)
            for name in NAMES
        )  # fmt: skip
        self.terms = {name: (at,) for at, name in enumerate(NAMES)}
        self.joins = {}
        self.model = SimpleNamespace(odds=KAPPA)
        self.nominal, self.sd = np.zeros(6), np.ones(6)
        self.bounds = np.full(6, low), np.full(6, high)
        self.block = np.repeat(np.arange(BLOCKS), EACH)
        self.columns = rng.normal(size=(6, BLOCKS * EACH, 2))
        for first, second in alike:
            self.columns[second] = self.columns[first]

    def linear(self, target, sd=1.0, lam=1.0):
        weight = np.full(target.shape, sd**-2.0)
        design = dict(enumerate(self.columns))
        return Linear.of(
            self, design, dict.fromkeys(range(6), 1.0), target, weight, lam
        )


def planted(rng, problem, **effects):
    target = rng.normal(size=(BLOCKS * EACH, 2))
    for name, value in effects.items():
        target = target + value * problem.columns[NAMES.index(name)]
    return target


@pytest.mark.parametrize(
    "effects", [{}, {"a": 0.5}, {"a": 0.5, "c": -0.3}, {"b": 2.0, "d": 0.2, "e": 1.0}]
)
def test_what_is_planted_is_found_and_nothing_else(effects):
    rng = np.random.default_rng(0)
    problem = Rows(rng)
    linear = problem.linear(planted(rng, problem, **effects))
    _, found = search.best(linear)
    assert found == frozenset(effects)
    values = linear.solve(found)
    for name, value in effects.items():
        assert values[NAMES.index(name)] == pytest.approx(value, abs=0.15)


COSTS = """
import itertools
import numpy as np
from tests.gap.decomposition.test_linear import NAMES, Rows, planted
rng = np.random.default_rng(0)
problem = Rows(rng)
linear = problem.linear(planted(rng, problem, a=0.5, c=-0.3, e=1.0))
for size in range(7):
    for some in itertools.combinations(NAMES, size):
        print(linear.cost(frozenset(some)).hex())
"""


def test_costs_do_not_depend_on_the_order_of_a_set():
    """Sets of names are gone through in another order in each process."""
    said = {
        subprocess.run(
            [sys.executable, "-c", COSTS], check=True, capture_output=True, cwd=ROOT,
            env={**os.environ, "PYTHONHASHSEED": str(seed)},
        ).stdout
        for seed in (1, 2, 3)
    }  # fmt: skip
    assert len(said) == 1


def test_nothing_gives_nothing_nineteen_times_in_twenty():
    claims = 0
    for seed in range(60):
        rng = np.random.default_rng(seed)
        problem = Rows(rng)
        claims += bool(search.best(problem.linear(planted(rng, problem)))[1])
    assert claims <= 3


def test_what_lies_within_the_slack_is_no_explanation():
    rng = np.random.default_rng(1)
    problem = Rows(rng)
    assert search.best(problem.linear(planted(rng, problem, f=0.05)))[1] == frozenset()
    assert search.best(problem.linear(planted(rng, problem, f=0.5)))[1] == {"f"}


def test_what_looks_alike_costs_the_same():
    rng = np.random.default_rng(2)
    problem = Rows(rng, alike=[(0, 1)])
    linear = problem.linear(planted(rng, problem, a=0.6))
    cost, found = search.best(linear)
    assert found in ({"a"}, {"b"})
    assert linear.cost({"a"}) == pytest.approx(linear.cost({"b"}))
    assert linear.cost({"a", "b"}) > cost + 0.5 * KAPPA
    near = [support for _, support in search.near(linear, 1.0)]
    assert {"a"} in near and {"b"} in near
    assert search.inclusion(linear, "a") == pytest.approx(search.inclusion(linear, "b"))


def test_intervals_hold_the_truth_as_often_as_they_say():
    held = 0
    for seed in range(200):
        rng = np.random.default_rng(seed)
        problem = Rows(rng)
        linear = problem.linear(planted(rng, problem, a=0.5))
        spread = 1.645 * np.sqrt(linear.covariance({"a"})[0, 0])
        held += abs(linear.solve({"a"})[0] - 0.5) < spread
    assert 0.83 <= held / 200 <= 0.96


def test_a_bound_is_kept():
    rng = np.random.default_rng(3)
    problem = Rows(rng, low=0.0)
    assert search.best(problem.linear(planted(rng, problem, a=-0.5)))[1] == frozenset()


def test_held_out_squares_fall_for_what_is_there_and_rise_for_what_is_not():
    rng = np.random.default_rng(4)
    problem = Rows(rng)
    linear = problem.linear(planted(rng, problem, a=0.5))
    nothing = linear.held_out(()).sum()
    assert linear.held_out({"a"}).sum() < nothing
    assert linear.held_out({"a", "b", "c", "d"}).sum() > linear.held_out({"a"}).sum()


def test_what_one_stretch_alone_shows_is_held_out_in_parts_of_it():
    rng = np.random.default_rng(6)
    problem = Rows(rng)
    problem.columns[0][problem.block != 3] = 0.0
    linear = problem.linear(planted(rng, problem, a=3.0))
    assert linear.held_out({"a"}).sum() > 0.9 * linear.held_out(()).sum()
    block = shares._pieces(problem.block, shares.PIECES)
    assert np.array_equal(np.unique(block), np.arange(BLOCKS * shares.PIECES))
    parts = linear.in_blocks(block)
    assert parts.squares(()) == pytest.approx(linear.squares(()))
    assert parts.held_out({"a"}).sum() < 0.7 * parts.held_out(()).sum()


def test_shares_are_of_what_is_closed_where_the_rest_does_not_last():
    rng = np.random.default_rng(0)
    problem = Rows(rng)
    linear = problem.linear(planted(rng, problem, a=0.5, c=0.5))
    point = SimpleNamespace(
        linear=linear,
        support=frozenset({"a"}),
        values=linear.solve({"a"}),
        noise=SimpleNamespace(order=0, latent=SimpleNamespace(parts=())),
    )
    (part,) = shares.parts(problem, point, lasting=False)
    assert part.last == part.alone == pytest.approx(1.0)
    (part,) = shares.parts(problem, point, lasting=True)
    assert part.last == part.alone == pytest.approx(0.5, abs=0.1)


def test_a_row_that_sets_in_is_a_column_of_its_own():
    rng = np.random.default_rng(5)
    problem = Rows(rng)
    target = planted(rng, problem)
    late = problem.block >= 5
    target[late] += 0.6 * problem.columns[0][late]
    linear = problem.linear(target)
    costs = {
        k: linear.since("a", np.arange(BLOCKS) >= k, "a@").cost({"a@"})
        for k in range(1, BLOCKS)
    }
    assert min(costs, key=costs.get) == 5
    assert costs[5] < linear.cost({"a"}) - 3


def test_residuals_that_repeat_count_once():
    rng = np.random.default_rng(6)
    problem = Rows(rng)
    slow = np.repeat(rng.normal(size=(BLOCKS * EACH // 10, 2)), 10, axis=0)
    trial = problem.block
    assert correlated(slow, trial) > 5
    assert correlated(rng.normal(size=slow.shape), trial) < 1.3
    problem.columns = np.repeat(problem.columns[:, ::10], 10, axis=1)
    linear = problem.linear(slow)
    assert inflation(linear, linear.solve(())) > 4


def test_the_noise_is_measured_and_grows_with_the_motion():
    rng = np.random.default_rng(7)
    speed = rng.uniform(0, 1, size=(4000, 1))
    true = np.hypot(0.1, 0.5 * speed)
    rest = true * rng.standard_t(4, size=speed.shape) / np.sqrt(2)
    rest[::50] += 20.0  # wild points
    made = scale(rest, speed, np.array([1e-3]))
    middle = rest / made
    assert np.median(np.abs(middle)) == pytest.approx(0.6745, rel=0.05)
    slow, fast = speed[:, 0] < 0.1, speed[:, 0] > 0.9
    assert made[fast].mean() / made[slow].mean() == pytest.approx(
        true[fast].mean() / true[slow].mean(), rel=0.25
    )
    heavy = weights(rest, made, np.isfinite(rest)) * made**2
    assert heavy[::50].max() < 0.15 < 0.9 < np.median(heavy)


def test_an_autoregression_is_taken_out():
    rng = np.random.default_rng(8)
    trial = np.repeat(np.arange(4), 500)
    values = np.zeros((2000, 1))
    noise = rng.normal(size=2000)
    for at in range(1, 2000):
        values[at] = 0.9 * values[at - 1] + noise[at]
    memory = Memory.of(values, trial, 1)
    assert memory.factors[0, 0] == pytest.approx(0.9, abs=0.05)
    assert correlated(memory(values), trial) < 1.3 < 5 < correlated(values, trial)
    assert Memory.of(values, trial, 0)(values) is values


@pytest.mark.parametrize(("value", "kept"), [(0.98, True), (1.02, True), (1.3, False)])
def test_a_whole_loss_is_kept_though_noise_puts_it_beyond_its_bound(value, kept):
    """A level at the bound of its row: an estimate a little beyond says the bound."""
    rng = np.random.default_rng(7)
    problem = Rows(rng, low=0.0, high=1.0, smooth=False)
    linear = problem.linear(planted(rng, problem, a=value), lam=1.0)
    found = linear.solve({"a"})[0]
    assert abs(found - value) < 0.08
    assert (search.best(linear)[1] == {"a"}) == kept


@pytest.mark.parametrize(("value", "kept"), [(1.05, True), (1.3, False)])
def test_what_the_data_leave_open_to_a_bound_is_at_it(value, kept):
    rng = np.random.default_rng(7)
    problem = Rows(rng, high=1.0)
    linear = problem.linear(planted(rng, problem, a=value))
    found, sd = linear.solve({"a"})[0], np.sqrt(linear.covariance({"a"})[0, 0])
    assert found > 1.0 and (found - 1.0 < 3 * sd) == kept
    assert (search.best(linear)[1] == {"a"}) == kept


def test_the_cost_of_a_set_is_that_of_its_own_normal_equations():
    rng = np.random.default_rng(5)
    problem = Rows(rng)
    linear = problem.linear(planted(rng, problem, a=0.6, c=-1.2), sd=0.5, lam=2.0)
    for names in ("", "f", "ac", "abcdef"):
        own = Spread.of(*linear._total(), 2.0, linear.prior(names))
        paid = KAPPA * len(names)
        rows = [NAMES.index(name) for name in names]
        found = own.widened(rows, np.zeros(len(rows))).values
        paid += tail(found)
        assert linear.cost(names) == pytest.approx(own.cost + paid, abs=1e-6)
        assert found == pytest.approx(linear.solve(names)[rows], abs=1e-9)


def test_a_large_departure_costs_the_log_of_its_size():
    """Not its square: what moves a part may be damage of any size."""
    assert tail(np.array([0.5, -1.0, 0.0])) == 0.0
    assert 15.0**2 / 2 + tail(np.array([15.0])) == pytest.approx(0.5 + np.log(15.0))
    rng = np.random.default_rng(3)
    problem = Rows(rng)
    problem.columns[1] = 8 * problem.columns[0]
    linear = problem.linear(planted(rng, problem, b=1.0))
    assert linear.cost({"a"}) == pytest.approx(linear.cost({"b"}), abs=0.2)


def test_what_is_far_off_and_told_by_little_is_not_held_back():
    """Nor is a load many times what its link plausibly departs by."""
    rng = np.random.default_rng(3)
    problem = Rows(rng, low=-100.0, high=100.0)
    problem.columns[0] = 0.05 * problem.columns[1]
    linear = problem.linear(planted(rng, problem, a=40.0))
    assert linear.cost({"a"}) < linear.cost({"b"}) + 1.5
    assert search.best(linear)[1] in ({"a"}, {"b"})


def test_residuals_that_scatter_explains_weigh_as_what_it_leaves_of_them():
    rng = np.random.default_rng(4)
    problem = Rows(rng)
    problem.rows = (*problem.rows[:5], replace(problem.rows[5], slack=10.0))
    problem.seen = np.ones((BLOCKS * EACH, 2), dtype=bool)
    one = np.ones_like(problem.columns[0])
    known = Noise(
        one,
        Latent(one[0], (), 0 * one, one[:0]),
        Memory.none(problem.block, 2),
        lam=1.0,
    )
    costs = []
    for size in (0.0, 8.0):  # of what the slack of the last row explains
        rest = planted(np.random.default_rng(5), problem, f=size)
        linear = problem.linear(rest)
        slopes = dict(enumerate(problem.columns))
        nominal = problem.nominal
        at = Point(nominal, frozenset(), rest, linear, slopes, known, nominal)
        costs.append(refit.relinearised(problem, at, known).cost(()))
    assert costs[1] == pytest.approx(costs[0], abs=1.0)


@pytest.mark.parametrize(("apart", "dropped"), [(0.02, True), (0.5, False)])
def test_explanations_of_which_one_undoes_the_other_are_none(apart, dropped):
    rng = np.random.default_rng(4)
    problem = Rows(rng, alike=[(1, 2)])
    problem.columns[2] += apart * rng.normal(size=problem.columns[2].shape)
    linear = problem.linear(planted(rng, problem, a=3.0, b=2.0, c=-2.0))
    found = shares.cancelling(linear, frozenset("abc"))
    assert found == (frozenset("bc") if dropped else frozenset())


def test_a_small_explanation_that_nothing_undoes_stays():
    rng = np.random.default_rng(4)
    problem = Rows(rng)
    linear = problem.linear(planted(rng, problem, a=3.0, b=0.1))
    assert shares.cancelling(linear, frozenset("ab")) == frozenset()


@pytest.mark.parametrize(("size", "kept"), [(0.15, False), (0.3, True)])
def test_what_closes_little_has_to_be_sure(size, kept):
    rng = np.random.default_rng(4)
    problem = Rows(rng)
    linear = problem.linear(planted(rng, problem, a=5.0, b=size))
    assert linear.cost("ab") < linear.cost("a") - 2  # evidence as such has it
    values = np.array([5.0, size, 0.0, 0.0, 0.0, 0.0])
    point = SimpleNamespace(linear=linear, support=frozenset("ab"), values=values)
    found = shares.weighty(problem, point, left=0.0)
    assert found == frozenset("ab" if kept else "a")


def test_one_of_both_adds_nothing_to_one_of_each():
    rng = np.random.default_rng(7)
    problem = Rows(rng)
    problem.columns[0] = problem.columns[1] + problem.columns[2]
    problem.joins = {0: (1, 2)}
    linear = problem.linear(planted(rng, problem, b=2.0, c=-1.0))
    assert linear.cost(frozenset("abc")) == linear.cost(frozenset("bc")) + KAPPA
    assert linear.cost(frozenset("ab")) < linear.cost(frozenset("a"))


def test_what_only_a_nuisance_beyond_reason_makes_up_for_is_no_trifle():
    rng = np.random.default_rng(4)
    problem = Rows(rng, alike=[(1, 5)])
    problem.rows = (*problem.rows[:5], replace(problem.rows[5], nuisance=True, slack=0))
    linear = problem.linear(planted(rng, problem, a=30.0, b=20.0), sd=3.0)
    assert linear.squares("a") - linear.squares("ab") < 0.005 * linear.squares("")
    assert shares.cancelling(linear, frozenset("ab")) == frozenset()
    held = shares.HeldOut(linear, linear, linear.weight, {})  # nor where held out
    assert held.error("a").sum() < 1.05 * held.error("ab").sum()
    assert held.loss(frozenset("a")) > 1.2 * held.loss(frozenset("ab"))
    change = 20.0 * problem.columns[1]  # of a level: what it does nothing pays for
    fixed = shares.HeldOut(linear, linear, linear.weight, {"b": (change, change)})
    assert fixed.loss(frozenset("ab")) < 1.01 * fixed.error("ab").sum()


def test_what_scatters_in_one_channel_makes_up_for_nothing_in_another():
    held = shares.HeldOut(None, None, np.array([[4.0, 1.0, 0.0]]), {})
    scatter = np.array([[0.1, 3.0, 1.0]])
    assert held.floor(scatter, left=2.4) == pytest.approx(0.04 + 1.2)
