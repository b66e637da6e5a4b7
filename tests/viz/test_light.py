"""Light following as it is shown: figures of the dissertation, report, recording."""

import numpy as np
import pytest

from bns.experiment.run import train
from bns.tasks import registry as tasks
from bns.viz import figures, recording, report, scene
from bns.viz.figures.light import moving_mean, roamed
from bns.worlds.light import sensors
from bns.worlds.light.law import LightField
from tests.bns.robots import FakeLightWorld, small_light

SENSORS, FIELD = sensors.of("khepera3"), LightField()
FORWARD = [at for at, name in enumerate(SENSORS.names) if "back" not in name]
TEN = SENSORS.names.index("ir_front_left")


@pytest.fixture(scope="module")
def many():
    """18,000 readings from different angles and positions."""
    return roamed(SENSORS, FIELD)


def test_the_six_sensors_are_at_the_dissertations_angles():
    degrees = np.sort(np.degrees(SENSORS.heading[FORWARD]))
    assert degrees == pytest.approx([-85, -45, -10, 10, 45, 85])


def test_figure_5_5_each_sensor_is_brightest_where_it_looks(many):
    at = np.deg2rad(np.arange(-180, 180, 2))
    means = moving_mean(many.angle, many.counts, at)
    assert many.counts.min() >= 0 and many.counts.max() <= 4200
    for sensor in FORWARD:
        off = np.degrees((at - SENSORS.heading[sensor] + np.pi) % (2 * np.pi) - np.pi)
        curve = means[:, sensor]
        assert abs(off[curve.argmin()]) <= 8
        assert curve.min() < 1000
        assert curve[np.abs(off) > 100].min() > 3800  # dark behind
        for side in (-1, 1):  # dims steadily to both sides
            flank = curve[np.argsort(side * off)][np.sort(side * off) >= 8]
            assert (np.diff(flank) > -60).all()


def test_figure_5_5_is_the_same_to_both_sides(many):
    at = np.deg2rad(np.arange(-178, 180, 2))
    means = moving_mean(many.angle, many.counts, at)
    twin = [SENSORS.names.index(_twin(name)) for name in SENSORS.names]
    assert means[::-1][:, twin] == pytest.approx(means, abs=250)


def _twin(name):
    sides = {"left": "right", "right": "left"}
    return "_".join(sides.get(part, part) for part in name.split("_"))


def repeated(counts: np.ndarray) -> float:
    """Share of readings that are the commonest one."""
    return np.unique(counts, return_counts=True)[1].max() / len(counts)


def test_figure_5_6a_one_sensor_says_the_same_from_minus_5_to_25_degrees(many):
    angle, seen = np.degrees(many.angle), many.counts[:, TEN]
    assert repeated(seen[(angle > -5) & (angle < 25)]) > 0.5
    assert repeated(seen[(angle > 40) & (angle < 60)]) < 0.35
    assert repeated(seen[(angle > -40) & (angle < -20)]) < 0.35


def test_figure_5_6a_middling_readings_are_rare_because_the_flanks_are_steep(many):
    seen = many.counts[:, TEN]
    middle = ((seen > 1000) & (seen < 3000)).mean()
    assert middle < 0.15
    assert (seen <= 1000).mean() > 0.1 and (seen >= 3000).mean() > 0.6


def test_figure_5_6b_the_virtual_sensors_never_say_the_same(many):
    angle, virtual = np.degrees(many.angle), SENSORS.virtual(many.counts)
    for low in range(-60, 150, 10):  # the whole of the left one's range
        window = (angle >= low) & (angle < low + 10)
        assert repeated(virtual[window, 0]) < 0.1


def test_figure_5_6b_the_virtual_sensors_see_light_from_more_angles(many):
    at = np.deg2rad(np.arange(-180, 180, 2))
    single = moving_mean(many.angle, many.counts, at)[:, TEN]
    virtual = moving_mean(many.angle, SENSORS.virtual(many.counts), at)[:, 0]
    assert (virtual < 3800).sum() > 1.25 * (single < 3800).sum()


def test_noise_hides_single_readings_and_not_the_trend():
    one = roamed(SENSORS, FIELD, readings=360)
    rough = np.abs(np.diff(one.counts[:, TEN]))
    assert np.median(rough[np.abs(np.diff(one.counts[:, TEN])) > 0]) > 20
    assert rough.max() > 1500


def test_the_figure_shows_six_sensors_and_the_virtual_two():
    figure = figures.light_responses(SENSORS, FIELD)
    assert [len(axes.lines) for axes in figure.axes] == [6, 1, 2]


@pytest.fixture(scope="module")
def record():
    return train(small_light(), world=FakeLightWorld())


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


def test_all_that_is_written_in_figures_can_be_read(record, tmp_path, illegible):
    report.write(record, tmp_path / "report.html")
    assert illegible == [], "\n".join(illegible)
