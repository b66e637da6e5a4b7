"""What tests of runs share."""

import pytest

from bns.__main__ import WRONG_INPUT, main


@pytest.fixture(autouse=True)
def one_commit(monkeypatch):
    """Someone may commit between a run and the run it is compared with."""
    monkeypatch.setattr("bns.experiment.versions.commit", lambda: "test")


@pytest.fixture
def fakes():
    """The module `fakes`, whose learner is known by its name."""
    from tests.bns import fakes

    return fakes


@pytest.fixture
def said(capsys):
    """What a command prints, its exit code being `code`; an error is one line."""

    def run(*argv, code=0):
        assert main([str(word) for word in argv]) == code
        captured = capsys.readouterr()
        if code != WRONG_INPUT:
            return captured.out
        lines = captured.err.splitlines()
        assert "Traceback" not in captured.err and len(lines) == 1
        return captured.err

    return run


@pytest.fixture
def run(fakes, tmp_path):
    """A finished run of the fake learner."""
    fakes.train(tmp_path / "run")
    return tmp_path / "run"
