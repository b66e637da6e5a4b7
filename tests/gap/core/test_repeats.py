"""Scatter of motion is told from noise of the measurement by repeats."""

import numpy as np
import pytest

from bns.gap.core import repeats
from bns.gap.models.base import Windows

COUNT, LENGTH, NOISE = 90, 0.1, 1e-3  # windows, their length [s], noise [m]


def recorded(scatter, runs, seed):
    """Displacements of a robot that scatters, between noisy positions."""
    rng = np.random.default_rng(seed)
    steps = rng.normal(0, scatter * np.sqrt(LENGTH), (runs, COUNT, 1))
    seen = rng.normal(0, NOISE, (runs, COUNT + 1, 1))
    return 0.01 + steps + np.diff(seen, axis=1)


def found(scatter, runs=3, seed=0, lost=()):
    values = recorded(scatter, runs, seed)
    values[0, list(lost)] = np.nan
    difference = np.diff(np.eye(COUNT + 1), axis=0) * NOISE
    index = np.arange(COUNT)
    spans = Windows(index, index + 1, (index + 0.5) * LENGTH, np.full(COUNT, LENGTH))
    usual = np.array([1e-4])
    return repeats.scatter([values], [difference @ difference.T], [spans], usual)[0]


@pytest.mark.parametrize("scatter", (1e-3, 3e-3, 1e-2))
def test_scatter_is_found(scatter):
    several = [found(scatter, seed=seed) for seed in range(12)]
    assert np.mean(several) == pytest.approx(scatter, rel=0.15)


def test_noise_is_no_scatter():
    # Over windows of a second, noise alone would pass for some 1e-3.
    assert np.median([found(0.0, seed=s) for s in range(7)]) < 2e-4


def test_what_was_not_seen_is_left_out():
    assert found(3e-3, runs=4, lost=(3, 4, 50)) == pytest.approx(3e-3, rel=0.3)
    assert found(1e-3, lost=range(COUNT)) == 1e-4
