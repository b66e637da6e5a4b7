"""Chance: tests of a rest, and the improvement that noise alone gives."""

from types import SimpleNamespace

import numpy as np
import pytest
from scipy.stats import chi2

from bns.gap.core.null import Null, correlation, lasting, quiet
from bns.worlds.trial import POSE_CHANNELS, Channel

TRIALS, WINDOWS = 5, 80
ROWS = [
    slice(3 * WINDOWS * n, 3 * WINDOWS * (n + 1)) for n in range(TRIALS)
]  # three features
COUNT = 3 * WINDOWS * TRIALS


FEATURES = (Channel("forward", "m"), Channel("left", "m"), Channel("turn", "rad"))
EXACT = np.array([1e-4, 1e-4, 1e-3])  # m, m, rad


def problem(sigma=10 * EXACT):
    """As much of one as a test of a rest looks at."""
    return SimpleNamespace(
        model=SimpleNamespace(
            features=FEATURES, channels=POSE_CHANNELS, resolution=EXACT
        ),
        floor=SimpleNamespace(source="state reset", sigma=np.asarray(sigma)),
        whiten=SimpleNamespace(rows=ROWS),
        windows=[range(WINDOWS)] * TRIALS,
    )


def null(rng, directions=30):
    basis, _ = np.linalg.qr(rng.standard_normal((COUNT, directions)))
    return Null(np.sort(chi2.rvs(6, size=1000, random_state=rng)), basis)


@pytest.mark.parametrize("scale", [0.8, 1.0, 1.3])
def test_noise_has_no_structure_however_large_it_is(scale):
    rng = np.random.default_rng(1)
    chance = null(rng)
    p = [
        chance.misfit(problem(), scale * rng.standard_normal(COUNT))[0]
        for _ in range(300)
    ]
    assert np.mean(np.array(p) < 0.1) < 0.15
    assert np.mean(np.array(p) < 0.01) < 0.02
    assert np.median(p) > 0.4


def test_noise_with_a_heavy_tail_has_no_structure_either():
    rng = np.random.default_rng(2)
    chance = null(rng)
    p = [
        chance.misfit(problem(), rng.standard_t(4, COUNT) / np.sqrt(2))[0]
        for _ in range(300)
    ]
    assert np.mean(np.array(p) < 0.01) < 0.025


@pytest.mark.parametrize("size", [0.5, 1.0, 3.0])
def test_structure_is_counted_in_units_of_the_loss(size):
    rng = np.random.default_rng(3)
    slow = np.zeros((TRIALS, WINDOWS, 3))
    slow[:, :, 2] = size * np.sqrt(2) * np.sin(np.arange(WINDOWS) / 4)
    rest = rng.standard_normal(COUNT) + slow.ravel()
    p, excess = null(rng).misfit(problem(), rest)
    assert p < 1e-3
    assert excess == pytest.approx(COUNT / 3 * size**2, rel=0.5)


def test_far_below_the_noise_structure_is_none():
    slow = 0.1 * np.repeat(np.sin(np.arange(COUNT / 3) / 4), 3)
    chance = null(np.random.default_rng(4))
    assert chance.misfit(problem(), slow)[0] > 0.5


def test_correlation_is_the_share_that_goes_on():
    rng = np.random.default_rng(5)
    lasting = np.repeat(rng.standard_normal((TRIALS * 2, 1)), WINDOWS // 2, axis=0)
    found = correlation(problem(), np.tile(lasting, 3))
    assert found.share[0] == pytest.approx(1.0, abs=0.1)
    assert found.size[0].min() > 10


def test_chance_goes_on_beyond_the_draws():
    chance = null(np.random.default_rng(6))
    below, at = chance.threshold(0.2), chance.threshold(0.05)
    assert chance.p_gain(below) == pytest.approx(0.2, abs=0.01)
    assert chance.p_gain(at + 1e-9) == pytest.approx(0.05, abs=0.003)
    for gain in (20.0, 30.0, 40.0):
        surer = np.log10(chance.p_gain(gain) / chi2.sf(gain, 6))
        assert -0.3 < surer < 1.5  # rather too careful
    assert chance.p_gain(40.0) < 1e-4


def test_a_quiet_tracker_repeats_errors_within_its_accuracy():
    rng = np.random.default_rng(7)
    slow = np.zeros((TRIALS, WINDOWS, 3))
    slow[:, :, 2] = 0.7 * np.sqrt(2) * np.sin(np.arange(WINDOWS) / 4)
    rest = 0.3 * rng.standard_normal(COUNT) + slow.ravel()
    chance, still = null(rng), problem(EXACT)
    assert quiet(still).all()
    assert not quiet(problem()).any()
    assert quiet(problem([2e-4, 1e-4, 1e-3])).tolist() == [False, False, True]
    assert chance.misfit(problem(), rest)[0] < 1e-6
    assert chance.misfit(still, rest)[0] > 0.5  # within the accuracy
    assert chance.misfit(still, 3 * rest)[0] < 1e-6  # beyond it
    assert lasting(problem(), rest) == 1.0
    assert lasting(still, rest) > 3
    assert lasting(still, rng.standard_normal(COUNT)) < 1.4
