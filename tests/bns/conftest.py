"""What tests of runs share: the fake learner in the place of the real one."""

import sys

import pytest


@pytest.fixture(autouse=True)
def one_commit(monkeypatch):
    """Someone may commit between a run and the run it is compared with."""
    monkeypatch.setattr("bns.experiment.versions.commit", lambda: "test")


@pytest.fixture
def fakes(monkeypatch):
    """The module `fakes`, its learner in the place of the real one."""
    from tests.bns import fakes

    fakes.learner_modules(lambda name, m: monkeypatch.setitem(sys.modules, name, m))
    return fakes
