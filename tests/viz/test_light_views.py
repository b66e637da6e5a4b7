"""Report and recording of light following."""

import numpy as np
import pytest

from bns.experiment.run import train
from bns.tasks import registry as tasks
from bns.viz import figures, recording, report, scene
from tests.bns.light_fakes import FakeLightWorld, small


@pytest.fixture(scope="module")
def record():
    return train(small(), world=FakeLightWorld())


def test_the_report_speaks_of_the_lamp(record, tmp_path):
    page = report.write(record, tmp_path / "report.html").read_text()
    assert "light following" in page or record.config.preset in page
    assert "the lamp circled in one trial" in page
    assert "What the light sensors read" in page
    assert "objectives reached in one trial" not in page


def test_the_lamp_is_the_objective(record):
    shown = scene.picture(record.config)
    assert shown.objectives == {"lamp": (0.0, 0.0)}
    assert shown.radius == record.config.light.goal
    assert tasks.of(record.config).finish(record.poses[0, 0]) == 20


def test_readings_are_drawn_as_they_were_read(record):
    figure = figures.readings(record, replicate=1)
    real = record.extra["readings"][1]
    shown = [line.get_ydata() for line in figure.axes[0].lines]
    assert any(np.array_equal(rows[:, 0], line) for rows in real for line in shown)


def test_paths_begin_at_their_starts(record):
    figure = figures.starts(record, replicate=0)
    dots = [
        line.get_xydata()[0]
        for line in figure.axes[0].lines
        if len(line.get_xydata()) == 1
    ]
    for trial in range(record.trials):
        start = record.poses[0, trial, 0, :2]
        assert any(np.allclose(start, dot) for dot in dots)


def test_a_recording_is_written(record, tmp_path):
    made = recording.write(record, {}, tmp_path / "recording.rrd")
    assert made.stat().st_size > 10_000
