"""Numbers among the conditions of a trial."""

import numpy as np
import pytest

from bns.errors import FormatError
from bns.gap.recordings.conditions import as_number


@pytest.mark.parametrize("value", [0.1, np.float64(0.1), "0.1"])
def test_a_condition_is_read_as_a_number(value):
    assert as_number({"gain": value}, "gain") == 0.1


def test_a_condition_that_is_missing_has_its_default():
    assert as_number({}, "speed", 2.0) == 2.0


@pytest.mark.parametrize("value", ["fast", None, [1.0]])
def test_a_condition_that_is_no_number_is_named(value):
    with pytest.raises(FormatError, match="'speed'"):
        as_number({"speed": value}, "speed")
