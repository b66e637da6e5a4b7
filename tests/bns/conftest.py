"""What tests of runs share: the fake learner in the place of the real one."""

import sys
from pathlib import Path

import pytest

sys.path.insert(0, str(Path(__file__).parent))


@pytest.fixture
def fakes(monkeypatch):
    """The module `fakes`, its learner in the place of the real one."""
    import fakes

    fakes.learner_modules(lambda name, m: monkeypatch.setitem(sys.modules, name, m))
    return fakes
