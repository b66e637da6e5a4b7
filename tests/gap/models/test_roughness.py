"""Steps of derivatives where a simulation is rough."""

import numpy as np
import pytest

from bns.gap.decomposition.fit import FAR
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
        (0.0, 0.0, FAR),  # nothing to stand out of
        (0.01, 0.0, FAR),  # less than is felt
        (0.1, 0.0, FAR),  # so far a departure changes many times as much
        (1.0, 0.0, 1.0),
        (1.0, 99.0, FAR),  # the larger step tells another derivative
    ],
)
def test_steps_stand_out_of_the_roughness(rough, bent, share):
    made = roughness.stepped(ROWS, motion(rough=rough, bent=bent))
    assert [row.name for row in made] == [row.name for row in ROWS]
    assert {row.difference / row.sd for row in made} == {share}


def test_of_many_rows_none_steps_farther_than_a_slope_is_trusted():
    made = roughness.stepped(ROWS * 11, motion(rough=1.0, bent=0.0))
    assert {row.difference / row.sd for row in made} == {FAR}


def test_what_has_no_slope_and_what_has_a_step_of_its_own_stay():
    band = Row("band", 0.0, SD, 0.0, 1.0, smooth=False)
    fixed = Row("fixed", 1.0, SD, -9.0, 9.0, step=0.5)
    still = motion(rough=0.0, bent=0.0)
    assert roughness.stepped((band, fixed), still) == (band, fixed)


def test_nuisances_keep_their_step():
    clock = Row("clock", 0.0, SD, -1.0, 1.0, nuisance=True, step=0.001)
    *_, kept = roughness.stepped((*ROWS, clock), motion(rough=1.0, bent=0.0))
    assert kept == clock


def test_a_longer_step_of_time_is_seen_where_it_changes_what_rows_do():
    band = Row("band", 0.0, SD, 0.0, 1.0, smooth=False, levels=(0.2, 0.6, 0.8))
    rows = (*ROWS[:3], band)
    near = roughness.derivatives(rows, motion(rough=0.0, bent=0.0))
    whole = [SLOPE * SD] * 3 + [SLOPE * (0.6 - 1.0)]  # a departure; a level as it is
    assert near[:, 0, 0] == pytest.approx(whole)
    far = near * np.array([1.04, 1.0, 1.2, 0.9])[:, None, None]
    far[1, 7] = np.nan  # diverged
    assert roughness.apart(near, far).tolist() == [False, True, True, False]
