"""How many effects a recording calls for, where its trials do not agree."""

import pytest

from bns.gap.core.model_order import Rung, climb
from bns.gap.core.verdict import Calibration

WORTH = 15.0


def rung(size, loss, held_out):
    return Rung(size, loss, held_out, (((), 0.0),), 1.0, 0.0, 0.0)


@pytest.mark.parametrize(
    ("loss", "held_out", "size"),
    [
        (320.0, (195.0, 125.0), 1),  # improves on both trials
        (320.0, (239.0, 133.0), 0),  # might be chance, and one trial denies it
        (260.0, (239.0, 133.0), 1),  # so much is no chance
    ],
)
def test_an_effect_beyond_doubt_needs_no_other_trial(loss, held_out, size):
    found = [rung(0, 344.0, (208.0, 136.0)), rung(1, loss, held_out)]
    assert climb(found, WORTH, Calibration()).size == size


def test_a_second_effect_does():
    found = [
        rung(0, 900.0, (450.0, 450.0)),
        rung(1, 400.0, (200.0, 200.0)),
        rung(2, 300.0, (300.0, 190.0)),
    ]
    assert climb(found, WORTH, Calibration()).size == 1


def test_two_further_effects_have_to_be_worth_two():
    found = [
        rung(0, 900.0, (450.0, 450.0)),
        rung(1, 400.0, (200.0, 200.0)),
        rung(2, 390.0, (195.0, 195.0)),  # not worth it
        rung(3, 376.0, (188.0, 188.0)),  # worth more than one, less than two
    ]
    assert climb(found, WORTH, Calibration()).size == 1
