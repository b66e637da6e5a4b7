"""Steps of derivatives where a simulation is rough."""

import numpy as np
import pytest

from bns.gap.decomposition.row import Row
from bns.gap.models.mjcf import roughness

SD = 2.0
ROWS = tuple(Row(f"row{n}", 1.0, SD, -9.0, 9.0) for n in range(12))
SLOPE = 4.0


def motion(*, rough, bent):
    """What rows change of 400 windows of two channels: in proportion to how far they
    are from nominal, beyond half of `SD` by its square, and by noise however little."""
    rng = np.random.default_rng(7)

    def changed(sets):
        made = np.empty((len(sets), 400, 2))
        for at, values in enumerate(sets):
            (away,) = (value - 1.0 for value in values.values())
            size = SLOPE * away + bent * max(away - SD / 2, 0.0) ** 2
            made[at] = size + rough * rng.normal(size=(400, 2))
        return made

    return changed


@pytest.mark.parametrize(
    ("rough", "bent", "share"),
    [
        (0.0, 0.0, 0.1),  # nothing to stand out of
        (0.01, 0.0, 0.1),  # less than is felt
        (0.1, 0.0, 0.1),  # a tenth of the departure changes eight times as much
        (0.5, 0.0, 1.0),
        (0.5, 99.0, 0.1),  # the larger step tells another derivative
    ],
)
def test_steps_stand_out_of_the_roughness(rough, bent, share):
    made = roughness.stepped(ROWS, motion(rough=rough, bent=bent))
    assert [row.name for row in made] == [row.name for row in ROWS]
    assert {row.difference / row.sd for row in made} == {share}


@pytest.mark.parametrize(
    "rows", [ROWS * 11, (Row("band", 0.0, SD, 0.0, 1.0, smooth=False),)]
)
def test_many_rows_and_none_with_a_slope_stay(rows):
    assert roughness.stepped(rows, motion(rough=0.5, bent=0.0)) == rows


def test_nuisances_keep_their_step():
    clock = Row("clock", 0.0, SD, -1.0, 1.0, nuisance=True, step=0.001)
    *_, kept = roughness.stepped((*ROWS, clock), motion(rough=0.5, bent=0.0))
    assert kept == clock
