"""Statistics against known answers."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats as scipy_stats

from bns import stats
from bns.errors import BnsError
from bns.experiment.config import RunConfig
from bns.experiment.record import RunRecord
from bns.stats.compare import compare
from bns.stats.designs import MARGIN, Design, equivalence, of_share, power, up_to
from bns.stats.measures import bootstrap_median, median_band

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


def test_unequal_numbers_of_trials_are_said():
    cost = np.ones((2, 6))
    long, short = (record(cost[:, :n], onset=[2, 2], cost=cost[:, :n]) for n in (6, 4))
    assert compare([long, long], ["a", "b"]).notes == ()
    found = compare([long, short], ["a", "b"])
    observed, solved, recovered = found.notes
    assert observed.startswith(
        "observation looks at unequal numbers of trials (a 4, b 2): the cost is summed"
    )
    assert "trials (a 6, b 4)" in solved and "counts as never" in solved
    assert "trials (a 4, b 2)" in recovered and "counts as never" in recovered
    assert found.to_mapping()["notes"] == list(found.notes)
    later = record(cost, onset=[2, 3], cost=cost)
    assert "(a 3 to 4, b 2)" in compare([later, short], ["a", "b"]).notes[0]
    many = compare([long] * 7 + [short] * 2, [f"r{i}" for i in range(9)]).notes[0]
    assert "r5 4, and 3 more)" in many


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


@pytest.mark.parametrize(("a12", "runs"), [(0.65, 30), (0.65, 100), (0.3, 30)])
def test_power_is_how_often_the_test_finds_it(a12, runs):
    # normal sides whose A12 is Phi(shift / sqrt 2)
    shift = scipy_stats.norm.ppf(a12) * np.sqrt(2)
    rng = np.random.default_rng(1)
    a = rng.normal(shift, 1, (1500, runs))
    b = rng.normal(0, 1, (1500, runs))
    p = scipy_stats.mannwhitneyu(a, b, method="asymptotic", axis=1).pvalue
    assert power(a12, runs, runs) == pytest.approx((p < 0.05).mean(), abs=0.04)


def test_power_of_nothing_is_the_level_and_of_everything_is_one():
    assert power(0.5, 1000, 1000) == pytest.approx(0.05, abs=0.001)
    assert power(1.0, 30, 30) == power(0.0, 30, 30) == 1.0
    assert power(0.65, 30, 60) == pytest.approx(power(0.35, 60, 30))
    assert power(0.9, 2, 2) < 0.05  # two runs a side find nothing


@pytest.mark.parametrize(("a12", "runs"), [(1.2, 30), (0.5, 0)])
def test_power_of_what_is_none(a12, runs):
    with pytest.raises(BnsError, match="has no power"):
        power(a12, runs, runs)


def test_bootstrap_median_by_hand():
    assert bootstrap_median([4.0]) == (4.0, 4.0, 4.0)
    assert bootstrap_median([1.0, 3.0]).value == 2.0
    never = bootstrap_median([1.0, 2.0, np.inf])
    assert (never.value, never.low, never.high) == (2.0, 1.0, np.inf)
    values = np.random.default_rng(0).normal(size=30)
    assert bootstrap_median(values) == bootstrap_median(values)


def test_bootstrap_median_covers_at_its_nominal_rate():
    draws = np.random.default_rng(7).exponential(size=(30, 3000))
    _, low, high = median_band(draws)
    assert 0.92 <= np.mean((low <= np.log(2)) & (np.log(2) <= high)) <= 0.96


def test_bootstrap_of_a_curve_is_that_of_its_columns():
    curve = np.random.default_rng(2).normal(np.array([0, 5, 10]), size=(20, 3))
    middle, low, high = median_band(curve)
    np.testing.assert_allclose(middle, np.median(curve, axis=0))
    assert (low < middle).all() and (middle < high).all()


@pytest.mark.parametrize("values", [np.zeros((0, 2)), [[np.nan]], [1.0]])
def test_bootstrap_of_what_is_none(values):
    with pytest.raises(BnsError, match="no median"):
        median_band(np.array(values))
