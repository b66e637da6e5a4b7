"""A diagnosis of odometry as every other one, and the drive that it asks for."""

import numpy as np

from bns.gap import store
from bns.gap.models.odometry import record
from bns.gap.models.odometry.diagnosis import diagnose
from tests.gap.models.test_odometry import motions


def test_it_is_stored_and_planned_like_every_other(tmp_path):
    data = motions({"axle": -0.012, "mount_x": -0.006}, count=3000)
    found = record.of(diagnose(data), 1)
    assert found.verdict.kind == "either"
    store.save(found, tmp_path)
    again = store.load(tmp_path)
    assert again.model == record.MODEL
    assert again.verdict.named == found.verdict.named
    assert set(again.best.names) == set(found.verdict.named[0])
    made = record.planned(again)
    first = made.options[0].excitation
    assert first.name.startswith("long straight drive") and made.repeats >= 1
    way = (first.commands.values * first.commands.durations[:, None])[0]
    np.testing.assert_allclose(way, [2.0, 2.0])
    assert np.abs(first.commands.values).max() <= 0.11
