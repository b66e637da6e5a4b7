"""Power and bootstrap intervals against known answers."""

import numpy as np
import pytest
from scipy import stats as scipy_stats

from bns.errors import BnsError
from bns.stats import bootstrap
from bns.stats.power import power, runs_needed


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


def test_runs_needed_is_the_least_that_suffices():
    need = int(runs_needed(0.65))
    assert power(0.65, need, need) >= 0.8 > power(0.65, need - 1, need - 1)
    assert runs_needed(0.5) == np.inf


@pytest.mark.parametrize(("a12", "runs"), [(1.2, 30), (0.5, 0)])
def test_power_of_what_is_none(a12, runs):
    with pytest.raises(BnsError, match="has no power"):
        power(a12, runs, runs)


def test_bootstrap_median_by_hand():
    assert bootstrap.median([4.0]) == (4.0, 4.0, 4.0)
    assert bootstrap.median([1.0, 3.0]).value == 2.0
    never = bootstrap.median([1.0, 2.0, np.inf])
    assert (never.value, never.low, never.high) == (2.0, 1.0, np.inf)
    values = np.random.default_rng(0).normal(size=30)
    assert bootstrap.median(values) == bootstrap.median(values)


def test_bootstrap_median_covers_at_its_nominal_rate():
    draws = np.random.default_rng(7).exponential(size=(30, 3000))
    _, low, high = bootstrap.median_band(draws)
    assert 0.92 <= np.mean((low <= np.log(2)) & (np.log(2) <= high)) <= 0.96


def test_bootstrap_of_a_curve_is_that_of_its_columns():
    curve = np.random.default_rng(2).normal(np.array([0, 5, 10]), size=(20, 3))
    middle, low, high = bootstrap.median_band(curve)
    np.testing.assert_allclose(middle, np.median(curve, axis=0))
    assert (low < middle).all() and (middle < high).all()


@pytest.mark.parametrize("values", [np.zeros((0, 2)), [[np.nan]], [1.0]])
def test_bootstrap_of_what_is_none(values):
    with pytest.raises(BnsError, match="no median"):
        bootstrap.median_band(np.array(values))
