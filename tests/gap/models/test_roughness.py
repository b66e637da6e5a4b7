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


def steps_of(rows, changed):
    return roughness.stepped(rows, changed, roughness.level(rows, changed))


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
    made = steps_of(ROWS, motion(rough=rough, bent=bent))
    assert [row.name for row in made] == [row.name for row in ROWS]
    assert {row.difference / row.sd for row in made} == {share}


def test_of_many_rows_none_steps_farther_than_a_slope_is_trusted():
    made = steps_of(ROWS * 11, motion(rough=1.0, bent=0.0))
    assert {row.difference / row.sd for row in made} == {FAR}


def test_what_has_no_slope_and_what_has_a_step_of_its_own_stay():
    band = Row("band", 0.0, SD, 0.0, 1.0, smooth=False)
    fixed = Row("fixed", 1.0, SD, -9.0, 9.0, step=0.5)
    still = motion(rough=0.0, bent=0.0)
    assert steps_of((band, fixed), still) == (band, fixed)


def test_nuisances_keep_their_step():
    clock = Row("clock", 0.0, SD, -1.0, 1.0, nuisance=True, step=0.001)
    *_, kept = steps_of((*ROWS, clock), motion(rough=1.0, bent=0.0))
    assert kept == clock


def paced(off):
    """What rows change at a pace: by a longer step, some by a share more or less."""

    def at(pace):
        plain = motion(rough=0.0, bent=0.0)

        def changed(sets):
            made = plain(sets)
            for row, values in zip(made, sets, strict=True):
                row *= 1 + off.get((pace, *values), 0.0)
            return made

        return changed

    return at


@pytest.mark.parametrize(
    ("off", "pace", "own"),
    [
        ({}, 0.25, set()),
        ({(0.25, "row3"): 0.04}, 0.25, set()),  # as close as need be
        ({(0.25, "row3"): 0.5, (0.25, "row5"): np.nan}, 0.25, {"row3", "row5"}),
        ({(0.25, row.name): 0.5 for row in ROWS[::2]}, 0.5, set()),
        ({(p, row.name): 0.5 for row in ROWS[::2] for p in (0.25, 0.5)}, 1, set()),
    ],
)
def test_the_longest_step_of_time_is_taken_that_changes_few_rows(off, pace, own):
    found = roughness.of_pace(ROWS, (0.25, 0.5), paced(off), 0.0, 1.0)
    assert found == (pace, own)


def test_what_a_simulation_changes_itself_rules_out_no_longer_step():
    off = {(0.25, row.name): 0.5 for row in ROWS}
    found = roughness.of_pace(ROWS, (0.25,), paced(off), 99.0, 1.0)
    assert found == (0.25, set())


def test_of_what_has_no_slope_a_level_is_looked_at():
    band = Row("band", 0.0, SD, 0.0, 1.0, smooth=False, levels=(0.2, 0.6, 0.8))
    seen = set()

    def at(pace):
        def changed(sets):
            seen.update(tuple(values.items()) for values in sets)
            return np.ones((len(sets), 5, 1))

        return changed

    assert roughness.of_pace((band,), (0.5,), at, 0.0, 1.0) == (0.5, set())
    assert seen == {(("band", 0.6),)}
