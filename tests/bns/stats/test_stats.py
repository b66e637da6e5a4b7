"""Statistics against known answers."""

from dataclasses import replace

import numpy as np
import pytest

from bns import stats
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.stats.compare import compare

# |U - 450| and p as the dissertation prints it, thirty runs against thirty: tables
# 5.3, 5.5, 5.6, 5.7, 5.10, 5.18, 6.2, 6.3b, 6.6, 7.6b, 7.7b.
PRINTED = [
    (195, 0.00403),
    (214, 0.00160),
    (268, 0.00008),
    (247, 0.00027),
    (187, 0.00583),
    (138, 0.04207),
    (44, 0.52014),
    (46, 0.50114),
    (98, 0.14945),
    (121, 0.07483),
    (134, 0.04841),
    (57, 0.40354),
    (49, 0.47335),
    (31, 0.65204),
    (32, 0.64142),
]


def samples_with(u):
    """Two samples of thirty without ties of which the first has the statistic `u`."""
    a, b = np.arange(30) - 100.0, np.arange(30.0)
    for index in range(29, -1, -1):  # lift the largest as high as it takes
        above = min(30, u)
        a[index], u = above - 0.5 + index * 1e-3, u - above
    return a, b


@pytest.mark.parametrize(("distance", "printed"), PRINTED)
def test_p_is_the_dissertations(distance, printed):
    for u in (450 - distance, 450 + distance):
        a, b = samples_with(u)
        assert ((a[:, None] > b).sum(), len(set(a))) == (u, 30)
        assert f"{stats.mann_whitney(a, b):.5f}" == f"{printed:.5f}"
        assert stats.p_of_u(u, 30, 30) == pytest.approx(stats.mann_whitney(a, b))


def test_p_of_runs_that_never_got_there():
    never, some = [np.inf] * 10, [1.0] * 9 + [np.inf]
    assert stats.mann_whitney(never, never) == 1.0
    assert stats.mann_whitney(never, some) < 0.001


def test_holm_by_hand():
    # sorted 0.005 x 4, 0.01 x 3, 0.03 x 2, 0.04 x 1 -> raised to 0.06
    adjusted = stats.holm([0.01, 0.04, 0.03, 0.005])
    np.testing.assert_allclose(adjusted, [0.03, 0.06, 0.06, 0.02])
    assert stats.holm([0.9, 0.8]).max() == 1.0
    assert len(stats.holm([])) == 0


def test_a12_by_hand():
    assert stats.a12([1, 2, 3], [1, 2, 3]).value == 0.5
    assert stats.a12([2, 3], [1, 2]).value == pytest.approx(3.5 / 4)
    assert stats.a12([np.inf, 1], [0, 2]).value == pytest.approx(3 / 4)


def test_a12_interval_mirrors_and_stays_inside():
    rng = np.random.default_rng(1)
    a, b = rng.normal(0.7, 1, 20), rng.normal(0, 1, 30)
    one, other = stats.a12(a, b), stats.a12(b, a)
    assert one.low < one.value < one.high
    np.testing.assert_allclose([one.low, one.high], [1 - other.high, 1 - other.low])
    apart = stats.a12(a + 100, b)
    assert (apart.value, apart.high) == (1.0, 1.0)
    assert 0.8 < apart.low < 1.0


@pytest.mark.parametrize(
    ("shift", "true", "runs"),
    # A12 of two unit normals is Phi(shift / sqrt 2)
    [(0.0, 0.5, 30), (1.0, 0.76025, 30), (1.0, 0.76025, 10), (2.0, 0.92135, 30)],
)
def test_a12_interval_covers_at_its_nominal_rate(shift, true, runs):
    rng = np.random.default_rng(3)
    draws = rng.normal(size=(400, 2, runs))
    found = [stats.a12(a + shift, b) for a, b in draws]
    covered = np.mean([each.low <= true <= each.high for each in found])
    assert 0.92 <= covered <= 0.99  # 0.95, give or take three standard errors


def test_median_interval_is_that_of_the_order_statistics():
    values = np.arange(1.0, 31.0)  # thirty: the 10th and the 21st, as tabled
    assert stats.median_interval(values) == (15.5, 10.0, 21.0)
    assert stats.median_interval([3.0]) == (3.0, -np.inf, np.inf)


def test_median_interval_covers_at_least_at_its_nominal_rate():
    draws = np.random.default_rng(5).exponential(size=(1000, 30))
    found = [stats.median_interval(each) for each in draws]
    assert np.mean([f.low <= np.log(2) <= f.high for f in found]) >= 0.94


def test_median_with_runs_that_never_got_there():
    assert stats.median([1, 2, np.inf]) == 2
    assert stats.median([1, np.inf]) == np.inf
    assert stats.median([np.inf, np.inf]) == np.inf


@pytest.mark.parametrize("sample", [[], [1.0, np.nan], [[1.0]]])
def test_samples_that_are_none(sample):
    with pytest.raises(BnsError, match="cannot be compared"):
        stats.mann_whitney(sample, [1.0])


def record(solved, *, onset, cost=None):
    """A record of the given outcomes, ``(R, T)``."""
    solved = np.array(solved, dtype=float)
    runs, trials = solved.shape
    cost = np.ones_like(solved) if cost is None else np.array(cost, dtype=float)
    return RunRecord(
        config=RunConfig(trials=trials, replicates=runs),
        versions={},
        columns={"solved": solved, "fitness": cost, "fitness_best": cost},
        sent=np.zeros((runs, trials, 1, 3)),
        poses=np.zeros((runs, trials, 2, 3)),
        predicted=np.zeros((runs, trials, 2, 3)),
        damage_onset=np.array(onset),
    )


def test_trials_to_solve_and_recover_count_from_one():
    found = record(
        [[0, 1, 0, 0, 1], [1, 1, 1, 0, 0], [0, 0, 0, 0, 0], [0, 0, 0, 1, 0]],
        onset=[2, 2, 2, -1],
    )
    np.testing.assert_array_equal(stats.trials_to_solve(found), [2, 1, np.inf, 4])
    np.testing.assert_array_equal(
        stats.trials_to_recover(found), [3, 1, np.inf, np.nan]
    )
    late = replace(found, damage_onset=np.full(4, 5))
    assert np.isnan(stats.trials_to_recover(late)).all()


def test_observation_sums_the_best_cost_from_the_onset():
    found = record(np.zeros((2, 4)), onset=[2, -1], cost=[[1, 2, 4, 8], [1, 2, 4, 8]])
    np.testing.assert_array_equal(stats.observation_after(found), [12, 15])
    late = replace(found, damage_onset=np.array([9, 9]))
    assert np.isnan(stats.observation_after(late)).all()


def test_compare_by_hand():
    quick = record([[0, 1, 0, 1], [0, 0, 1, 0]], onset=[2, 2], cost=np.ones((2, 4)))
    slow = record([[0, 0, 0, 1], [0, 0, 0, 0]], onset=[2, 2], cost=np.full((2, 4), 9))
    found = compare([quick, slow], ["quick", "slow"])
    sides = {(s.name, s.measure): s for s in found.sides}
    assert sides["quick", "recover"].median.value == 1.5
    assert sides["slow", "recover"].median.value == np.inf
    assert sides["slow", "recover"].reached == 1
    assert sides["slow", "solve"].runs == 2
    pairs = {pair.measure: pair for pair in found.pairs}
    assert pairs["observation"].a12.value == 0.0
    assert pairs["recover"].p == pairs["recover"].p_holm
    plain = found.to_mapping()
    assert plain["runs"][0]["median"]["value"] == 2.0


def test_compare_needs_two_finished_runs():
    one = record([[0, 1]], onset=[0])
    with pytest.raises(BnsError, match="1 run was given"):
        compare([one])
    begun = replace(one, config=replace(one.config, trials=9))
    with pytest.raises(BnsError, match=r"2 of 9 trials.*--resume"):
        compare([one, begun])


def test_holm_in_compare_runs_over_the_pairs_of_a_measure():
    def made(cost):
        costs = np.repeat(np.array(cost)[:, None], 2, axis=1)
        return record(np.ones_like(costs), onset=[0] * len(cost), cost=costs)

    rng = np.random.default_rng(0)
    a, b, c = (made(rng.normal(shift, 1, 12)) for shift in (0, 1, 4))
    pairs = [p for p in compare([a, b, c]).pairs if p.measure == "observation"]
    p = [pair.p for pair in pairs]
    np.testing.assert_allclose([pair.p_holm for pair in pairs], stats.holm(p))
    assert len(pairs) == 3
