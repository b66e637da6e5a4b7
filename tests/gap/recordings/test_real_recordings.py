"""Diagnoses of real recordings, where there are any; see `bench.gap.real_data`."""

import numpy as np
import pytest

from bench.gap import real_data, servo
from bns.gap.importers import khepera3_odometry, mrclam6, xl330
from bns.gap.models.odometry.diagnosis import diagnose
from bns.gap.models.odometry.motions import Motions
from bns.gap.models.servo import diagnosis
from bns.gap.models.servo.candidates import candidates
from bns.gap.models.servo.nominal import Nominal, fit, usual
from bns.gap.models.servo.runs import cells, runs
from bns.models import servo_pendulum

CANDIDATES = (
    "servo_payload",
    "servo_lever",
    "servo_gain",
    "servo_coulomb",
    "servo_armature",
    "servo_delay",
)


def needs(name: str):
    """Skip a test, saying why, where a set of recordings is absent."""
    absent = real_data.directory(name) is None
    return pytest.mark.skipif(absent, reason=real_data.reason(name))


@needs("khepera3_odometry")
def test_khepera_wheels_or_axle_and_the_mount():
    home = real_data.needed("khepera3_odometry")
    trial = khepera3_odometry.read(home)
    assert len(trial.commands) == 4396
    found = diagnose(Motions.of(trial, axle=khepera3_odometry.AXLE))
    published = khepera3_odometry.published(home)
    supports = found.verdict.named
    assert found.verdict.kind == "either" and len(supports) == 2
    assert {"axle"} < set(supports[0]) ^ set(supports[1]) == {"axle", "both_diameters"}
    for support in supports:
        for name, theirs in (("mount_x", "l_x"), ("mount_angle", "l_theta")):
            away = found.fits[support].magnitudes[name] - published.values[theirs]
            assert abs(away) < 3 * published.deviations[theirs]
    assert found.plan[0][0].startswith("long straight drive")


@needs(servo.SET)
def test_servo_settings_that_are_mis_told():
    every = servo.load()
    assert len(every) == 960
    law = Nominal({**servo_pendulum.law(), "offset": 0.017}, 0.0)
    known = every.take(
        every.where(lambda k, n: k in (8, 16) and n in (1, 2), "gain", "repeat")
    )
    assert np.abs(law.predict(known) - known.angles).mean() < 0.03
    reference = diagnosis.learn(known, law, candidates=candidates(CANDIDATES))
    for true in sorted(set(cells(known)))[5:7]:
        mine = servo.of_cell(known, true, (1, 2))
        for at, kind in enumerate(("payload", "lever", "gain", "none")):
            told = list(true)
            if kind != "none":
                levels = sorted({cell[at] for cell in cells(known)} - {true[at]})
                told[at] = levels[-1]
            runs = servo.retold(mine, tuple(told))
            found, scores = diagnosis.diagnose(runs, reference, without=[true])
            if kind == "none":
                assert found.kind == "no gap"
            else:
                assert scores.ranked[0] == f"servo_{kind}"
                assert found.p_gap < 0.03


@needs("xl330")
def test_xl330_runs_are_read():
    trials = xl330.read(real_data.needed("xl330"))
    assert len(trials) == 16
    assert {trial.conditions["gain"] for trial in trials} == {100, 200, 400, 800}
    assert all(np.abs(trial.channel("current")).max() < 3 for trial in trials)


@needs("xl330")
def test_an_xl330_departs_from_its_published_law_as_other_fits_of_it_do():
    every = runs(xl330.read(real_data.needed("xl330")), seconds=5.9)
    published = usual(every)
    assert np.abs(published.predict(every) - every.angles).mean() < 0.06
    found = fit(every)
    assert found.error < 0.035
    between = {  # what BAM's own models, M1 to M6, find
        "torque_constant": (0.28, 0.39),
        "resistance": (2.4, 3.5),
        "armature": (0.0016, 0.0021),
    }
    for name, (low, high) in between.items():
        assert low < found.values[name] < high, name


@needs("mrclam6")
def test_mrclam_robots_are_read():
    home = real_data.needed("mrclam6")
    assert mrclam6.robots(home) == (1, 2, 3, 4, 5)
    trials = mrclam6.read(home, 3, seconds=60.0)
    assert len(trials) > 10
    for trial in trials:
        assert trial.commands.duration == pytest.approx(60.0, abs=0.01)
        assert np.abs(np.diff(trial.poses_world[:, 2])).max() < 1.0
