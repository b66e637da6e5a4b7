"""Commands of rows that a log lost."""

import numpy as np
import pytest

from bns.gap.decomposition.untold import STRETCHES, lost
from bns.gap.recordings import segments, trial_conditions
from bns.worlds.trial import Channel, Commands, Trial

STEP, COUNT = 0.01, 400
SD = np.array([0.2, 0.01])


def recording(lost):
    """Two commands that change by chance in each row, some of them not known."""
    values = SD * np.random.default_rng(0).standard_normal((COUNT, 2))
    kinds = (Channel("a", "V"), Channel("b", "V"))
    told = Commands(values, np.full(COUNT, STEP), kinds)
    times = np.arange(COUNT + 1) * STEP
    return Trial(
        told,
        times,
        np.zeros((COUNT + 1, 1)),
        np.arange(COUNT + 1),
        channels=(Channel("x", "m"),),
        conditions={trial_conditions.BETWEEN: [times[row] for row in lost]},
    )


def test_commands_may_be_off_as_far_as_others_are_from_those_beside_them():
    trial = recording([50, 51, 52, 300])
    made = lost(trial)
    off = [item.trial.commands.values - trial.commands.values for item in made]
    rows = [sorted(set(np.argwhere(change)[:, 0].tolist())) for change in off]
    assert sorted(rows) == [[50, 51, 52], [50, 51, 52], [300], [300]]
    sizes = {
        (row[0], bool(c[:, 0].any())): c.max() for row, c in zip(rows, off, strict=True)
    }
    for channel, sd in enumerate(SD):  # of n: 1 / n + 1 / 2
        assert sizes[50, not channel] == pytest.approx(sd * (5 / 6) ** 0.5, rel=0.15)
        assert sizes[300, not channel] == pytest.approx(sd * 1.5**0.5, rel=0.15)


def test_none_are_made_where_all_rows_are_there():
    assert lost(recording([])) == []


def test_the_least_sure_ones_are_open():
    made = lost(recording(range(5, 395, 10)))
    assert len(made) == STRETCHES
    trial = recording([])
    for item in made:
        assert (item.trial.commands.values != trial.commands.values)[:, 0].any()


def test_a_piece_knows_which_of_its_commands_were_lost():
    trial = recording([50, 51, 300])
    part = segments.piece(trial, 40, 200)
    assert np.flatnonzero(trial_conditions.between(part)).tolist() == [10, 11]
