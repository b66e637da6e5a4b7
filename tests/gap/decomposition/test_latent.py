"""What is not known of trials: taken out, residuals are independent again."""

from types import SimpleNamespace

import numpy as np
import pytest

from bns.gap.decomposition.evidence.latent import Latent

TRIALS, LENGTH, SD = 3, 20, np.array([0.5, 2.0])
REST = np.zeros((TRIALS * LENGTH, 2))


@pytest.fixture
def problem():
    rng = np.random.default_rng(0)
    growth = np.exp(np.linspace(0, 2, LENGTH))[:, None]
    moved = np.stack([growth * rng.normal(size=2) for _ in range(TRIALS * 2)])
    moved = moved.reshape(2, TRIALS * LENGTH, 2)
    return SimpleNamespace(
        model=SimpleNamespace(least=SD),
        seen=np.ones((TRIALS * LENGTH, 2), dtype=bool),
        trials=(None,) * TRIALS,
        trial=np.repeat(np.arange(TRIALS), LENGTH),
        begun=lambda values: moved,
        open_commands=[np.zeros((0, LENGTH, 2))] * TRIALS,
        any_open=False,
    )


def covariance(problem, trial):
    """Of a trial's residuals in deviations: measurement and start."""
    units = problem.begun(None)[:, problem.trial == trial] / SD
    flat = units.reshape(2, -1)
    return np.eye(flat.shape[1]) + flat.T @ flat


def test_residuals_are_independent_without_what_is_unknown_of_trials(problem):
    latent = Latent.of(problem, np.zeros(0), REST)
    for trial in range(TRIALS):
        rows = problem.trial == trial
        columns = []
        for unit in np.eye(rows.sum() * 2):
            values = np.zeros((len(rows), 2))
            values[rows] = unit.reshape(-1, 2) * SD
            columns.append((latent(values)[rows] / SD).ravel())
        whitening = np.array(columns)
        found = whitening @ covariance(problem, trial) @ whitening.T
        assert found == pytest.approx(np.eye(len(found)), abs=2e-2)


def test_their_size_is_half_the_log_of_the_determinant(problem):
    wanted = sum(np.linalg.slogdet(covariance(problem, t))[1] for t in range(TRIALS))
    assert Latent.of(problem, np.zeros(0), REST).size == pytest.approx(
        wanted / 2, rel=1e-3
    )


def test_known_starts_and_moments_change_nothing(problem):
    problem.begun = lambda values: np.zeros((0, TRIALS * LENGTH, 2))
    latent = Latent.of(problem, np.zeros(0), REST)
    values = np.random.default_rng(1).normal(size=(TRIALS * LENGTH, 2))
    assert latent(values) is values
    assert latent.size == 0 and not latent.spread.any()
