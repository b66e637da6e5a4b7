"""What tests of the diagnosis of wheeled robots share."""

import numpy as np
import pytest

from bns.gap.bench.wheeled_cases import commands
from bns.gap.models.wheeled.model import WheeledModel


@pytest.fixture(scope="module")
def model():
    """The nominal Khepera III."""
    return WheeledModel(threads=1)


@pytest.fixture(scope="module")
def told():
    """Four lists of commands."""
    return commands(np.random.default_rng(3), 4)
