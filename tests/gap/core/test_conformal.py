"""Conformal calibration of intervals."""

import numpy as np
import pytest

from bns.gap.core import conformal, uncertainty, verdict


def test_times_are_apart_from_other_magnitudes():
    assert conformal.group("command_latency", "s") == conformal.TIMING
    assert conformal.group("clock_drift", "1") == conformal.TIMING
    assert conformal.group("axle_length", "1") == conformal.OTHER


def test_intervals_hold_as_often_as_they_say():
    for name, found in conformal.errors().items():
        effect, unit = ("late", "s") if name == conformal.TIMING else ("axle", "1")
        for coverage in (0.5, 0.9):
            reach = conformal.reach(effect, unit, coverage)
            held = np.mean(np.array(found) <= reach)
            assert coverage <= held < coverage + 2 / len(found)


def test_width_is_the_calibrated_multiple_of_the_standard_error():
    rules = verdict.Calibration(model_error=0.03, widen=2.0, coverage=0.9)
    error = uncertainty.standard_error(0.4, 10.0, rules)
    assert error == pytest.approx(0.5)
    half = uncertainty.half_width(error, "axle_length", "1", rules)
    assert half == pytest.approx(conformal.reach("axle_length", "1", 0.9))


def test_sets_are_calibrated_by_the_scores_that_are_kept():
    rules = verdict.calibration()
    assert rules.tie == verdict.quantile(rules.scores, rules.coverage)
