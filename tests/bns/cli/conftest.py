"""What tests of the command line share."""

import pytest


@pytest.fixture
def run(fakes, tmp_path):
    """A finished run of the fake learner."""
    fakes.train(tmp_path / "run")
    return tmp_path / "run"
