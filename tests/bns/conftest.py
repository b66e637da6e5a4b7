"""What tests of runs share."""

import pytest


@pytest.fixture(autouse=True)
def one_commit(monkeypatch):
    """Someone may commit between a run and the run it is compared with."""
    monkeypatch.setattr("bns.experiment.versions.commit", lambda: "test")


@pytest.fixture
def fakes():
    """The module `fakes`, whose learner is known by its name."""
    from tests.bns import fakes

    return fakes
