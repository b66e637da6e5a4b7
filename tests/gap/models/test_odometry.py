"""Odometry diagnosis against planted wheels, axles, mounts; the drive it asks for."""

import numpy as np
import pytest

from bns.errors import BnsError
from bns.gap import store
from bns.gap.importers.khepera3_odometry import chained
from bns.gap.models.odometry import diagnosis, record
from bns.gap.models.odometry.diagnosis import diagnose
from bns.gap.models.odometry.fit import TERMS, problem
from bns.gap.models.odometry.motions import (
    NUMBERS,
    TURN,
    Motions,
    changed,
    start,
    wrapped,
)
from bns.worlds.trial import Channel, Commands, Trial

AXLE, INTERVAL = 0.0884, 0.8
SCATTER = np.array([7e-4, 5e-4, 1.7e-3])


def motions(magnitudes, *, speed=0.01, count=1200, bias=0.0, seed=0) -> Motions:
    """Drives ahead, back and on the spot, with scatter, lost matches and a bias."""
    rng = np.random.default_rng(seed)
    kinds = np.array([(1, 1), (-1, -1), (-1, 1), (1, -1)])[rng.integers(0, 4, count)]
    ways = kinds * speed * INTERVAL * rng.uniform(0.95, 1.0, (count, 2))
    clean = Motions(ways[:, 0], ways[:, 1], np.zeros((count, 3)), AXLE)
    truth = changed({"length_bias": bias})
    for name, value in magnitudes.items():
        truth += changed(dict.fromkeys(TERMS[name].numbers, value))
    seen = clean.predict(truth) + rng.normal(0, SCATTER, (count, 3))
    seen[rng.integers(0, count, 5)] += 0.1
    return Motions(ways[:, 0], ways[:, 1], seen, AXLE)


class TestKinematics:
    def test_straight_spin_and_arc(self):
        quarter = np.pi / 2
        left = np.array([0.2, -AXLE / 2 * quarter, 0.0])
        right = np.array([0.2, AXLE / 2 * quarter, AXLE * quarter])
        still = Motions(left, right, np.zeros((3, 3)), AXLE)
        straight, spin, arc = still.predict(changed({}))
        np.testing.assert_allclose(straight, [0.2, 0, 0], atol=1e-15)
        np.testing.assert_allclose(spin, [0, 0, quarter], atol=1e-15)
        np.testing.assert_allclose(arc, [AXLE / 2, AXLE / 2, quarter], atol=1e-15)

    def test_a_mount_ahead_swings_and_its_angle_turns_the_frame(self):
        spin = Motions(*np.array([[-1.0], [1.0]]) * AXLE / 4 * np.pi, None, AXLE)
        ahead = spin.predict(changed({"mount_x": 0.01}))[0]
        np.testing.assert_allclose(ahead, [-0.01, 0.01, np.pi / 2], atol=1e-15)
        drive = Motions(np.ones(1), np.ones(1), None, AXLE)
        turned = drive.predict(changed({"mount_angle": np.pi / 2}))[0]
        np.testing.assert_allclose(turned, [0, -1, 0], atol=1e-15)

    def test_from_a_trial(self):
        moved = np.array([[0.01, 0.0, 0.1], [0.02, 0.001, -0.2]])
        told = Commands(np.array([[0.1, 0.2], [0.3, 0.4]]), np.array([1.0, 2.0]))
        trial = Trial(told, np.array([0.0, 1.0, 3.0]), chained(moved), np.arange(3))
        found = Motions.of(trial, axle=AXLE)
        np.testing.assert_allclose(found.left, [0.1, 0.6])
        np.testing.assert_allclose(found.seen, moved, atol=1e-15)
        goal = Commands(told.values[:, :1], told.durations, (Channel("goal", "rad"),))
        with pytest.raises(BnsError, match="left_speed and right_speed"):
            Motions.of(trial.replace(commands=goal), axle=AXLE)


def test_a_bias_of_lengths_lies_along_the_travel():
    ways = np.array([0.02, -0.02, 0.02]), np.array([0.02, -0.02, -0.02])
    drive = Motions(*ways, None, AXLE)
    turned = changed({"mount_angle": 2.0, "length_bias": 1e-3})
    added = drive.predict(turned) - drive.predict(changed({"mount_angle": 2.0}))
    ahead = 1e-3 * np.array([np.cos(2.0), -np.sin(2.0), 0])
    np.testing.assert_allclose(added, [ahead, -ahead, 0 * ahead], atol=1e-15)


@pytest.mark.parametrize("angle", [-3.1, -1.7, 0.0, 0.9, 2.4])
def test_a_start_is_right_at_any_heading(angle):
    truth = {"left_diameter": 0.03, "mount_x": 0.03, "mount_y": -0.05}
    data = motions({**truth, "mount_angle": angle}, speed=0.05)
    found = start(data)
    assert abs(wrapped(found[TURN] - angle)) < 5e-3
    for name, value in truth.items():
        assert found[NUMBERS.index(name)] == pytest.approx(value, abs=2e-3)


def test_numbers_come_back_within_their_deviations():
    truth = {
        "axle": -0.01,
        "left_diameter": 0.02,
        "mount_x": -0.006,
        "mount_y": 0.002,
        "mount_angle": -2.9,
    }
    made = problem(motions(truth, speed=0.1, count=4000), length_bias=0.0)
    np.testing.assert_allclose(made.noise.deviation, SCATTER, rtol=0.1)
    found = made.fit(tuple(truth), slack=0.0)
    for name, value in truth.items():
        assert abs(found.magnitudes[name] - value) < 4 * found.deviations[name]
        assert found.deviations[name] < 1e-3


def test_a_bias_of_lengths_makes_diameters_uncertain():
    data, names = motions({}, bias=2e-4), ("axle", "both_diameters")
    sure, unsure = (
        problem(data, length_bias=bias).fit(names, slack=0.0) for bias in (0.0, 2e-4)
    )
    name = "both_diameters"
    assert unsure.deviations[name] > 2 * sure.deviations[name]
    assert abs(sure.magnitudes[name]) > 5 * sure.deviations[name]
    assert abs(unsure.magnitudes[name]) < 3 * unsure.deviations[name]


def test_five_departures_come_out_together():
    truth = {
        "axle": 0.03,
        "left_diameter": -0.02,
        "mount_x": 0.04,
        "mount_y": -0.02,
        "mount_angle": 1.9,
    }
    found = diagnosis.diagnose(motions(truth, speed=0.1, count=2400))
    fits = [found.fits[s] for s in found.verdict.named if set(s) == set(truth)]
    assert len(fits) == 1
    for name, value in truth.items():
        assert abs(fits[0].magnitudes[name] - value) < 4 * fits[0].deviations[name]
    last = found.shares["mount_angle"][1]
    assert last > 0.1 and last > found.shares["left_diameter"][1] > 0


def test_spins_alone_leave_the_heading_open():
    rng = np.random.default_rng(0)
    way = rng.choice([-1.0, 1.0], 1200) * rng.uniform(0.02, 0.03, 1200)
    clean = Motions(-way, way, np.zeros((1200, 3)), AXLE)
    truth = {"mount_x": 0.03, "mount_y": 0.01, "mount_angle": 2.5}
    seen = clean.predict(changed(truth)) + rng.normal(0, SCATTER, (1200, 3))
    found = diagnosis.diagnose(Motions(-way, way, seen, AXLE))
    assert found.unseen == ("mount_angle",)
    assert found.verdict.named == (("mount_x", "mount_y"),)
    fit = found.fits["mount_x", "mount_y"]
    assert np.hypot(*fit.magnitudes.values()) == pytest.approx(0.0316, abs=2e-3)
    for name in fit.names:
        assert abs(fit.magnitudes[name] - truth[name]) < 3 * fit.deviations[name]
    assert "mount_angle these drives say nothing" in found.verdict.sentence


def test_slow_drives_tie_axle_and_diameters_and_ask_for_a_long_one():
    data = motions({"both_diameters": 0.0126, "mount_x": -0.0058}, count=2400)
    found = diagnosis.diagnose(data)
    assert found.verdict.kind == "either"
    assert set(found.verdict.named) == {
        ("both_diameters", "mount_x"),
        ("axle", "mount_x"),
    }
    for support in found.verdict.named:
        mount = found.fits[support].magnitudes["mount_x"]
        assert mount == pytest.approx(-0.0058, abs=4e-4)
    assert found.verdict.angle < 15
    assert found.plan[0][0].startswith("long straight drive")
    assert found.plan[0][1] > 3 > found.plan[-1][1]
    assert "long straight" in found.verdict.change


def test_fast_drives_settle_it():
    data = motions({"both_diameters": 0.02}, speed=0.3, count=2400)
    found = diagnosis.diagnose(data)
    assert found.verdict.kind == "effect"
    assert found.verdict.named == (("both_diameters",),)
    magnitude = found.fits["both_diameters",].magnitudes["both_diameters"]
    assert magnitude == pytest.approx(0.02, abs=5e-4)
    assert f"both_diameters {100 * magnitude:+.2f} %" in found.verdict.sentence
    assert found.plan == ()


def test_nothing_is_nothing():
    for seed in range(3):
        found = diagnosis.diagnose(motions({}, seed=seed))
        assert found.verdict.kind == "no gap" and found.verdict.named == ()


def test_too_few_intervals_are_refused():
    with pytest.raises(BnsError, match="100 intervals are too few"):
        diagnosis.diagnose(motions({}, count=100))


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
