"""Gaussian processes of several values, and the squared exponential kernel."""

import numpy as np
import pytest

from bns.prior import gaussian


def test_several_processes_at_the_same_places_are_each_as_alone():
    rng = np.random.default_rng(0)
    known, wanted, values = rng.random((9, 3)), rng.random((5, 3)), rng.random((9, 2))
    rule = {"reach": 0.5, "noise": 0.02, "kernel": gaussian.exponential}
    mean, spread = gaussian.posterior(known, values, wanted, **rule)
    for column in range(2):
        alone, same = gaussian.posterior(known, values[:, column], wanted, **rule)
        np.testing.assert_allclose(mean[:, column], alone)
        np.testing.assert_array_equal(spread, same)
    none, one = gaussian.posterior(known[:0], values[:0], wanted, **rule)
    assert none.shape == (5, 2) and (one == 1).all()


def test_the_exponential_kernel_is_the_textbook_formula():
    found = gaussian.exponential(np.zeros((1, 2)), np.array([[0.3, 0.4]]), 0.5)
    assert found[0, 0] == pytest.approx(np.exp(-0.5))
    with pytest.raises(np.linalg.LinAlgError):  # the same place twice, and no noise
        twice = np.zeros((2, 1))
        gaussian.posterior(twice, np.ones(2), twice, reach=1.0, noise=-1e-3)
