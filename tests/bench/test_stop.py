"""What of a standstill is the robot's own."""

from itertools import pairwise

import numpy as np
import pytest

from bench.hardware import stop
from bns.hardware.emulators.hexapod import HexapodBody


@pytest.mark.parametrize(
    ("rows", "sinks", "rest"),
    [
        ([(0.0, False), (1.3, True)], False, 1.3),
        ([(0.0, False), (1.3, True), (1.35, False), (1.5, True)], False, 1.5),
        ([(0.0, True)], False, 1.0),
        ([(0.0, True), (1.05, False), (1.4, True)], True, 1.4),
        ([(0.0, True), (2.0, False)], True, 1.0),  # it was moved, long after
        ([(0.0, False)], False, None),
    ],
)
def test_rest_is_what_lasts_and_a_robot_on_its_legs_sinks_first(rows, sinks, rest):
    assert stop.came_to_rest(rows, 1.0, sinks=sinks) == rest


def test_wheels_stand_after_what_their_lag_and_their_speed_make():
    slowest = 0.136 * np.log(stop.SPEEDS[1] / stop.SLOW)  # models/khepera3/README.md
    assert 0.8 * slowest < stop.khepera3_ramp() < 1.1 * slowest


def test_a_hexapod_without_torque_falls_as_its_body_does_and_one_that_lies_rests():
    body = HexapodBody()
    for number in body.joints:
        body.tell(number, 512)
        body.power(number, True)
    body.advance(1.5)
    falls = stop.phantomx_ramp(body.state)
    assert 0.1 < falls < 0.6
    for number in body.joints:
        body.power(number, False)
    begin, rested = body.now, []
    while body.now < begin + 1.0:
        body.advance(body.now + stop.ROUND)
        rested.append((body.now, body.rests()))
    found = stop.came_to_rest(changes(rested), begin, sinks=True)
    assert found - begin == pytest.approx(falls, abs=0.02)
    assert stop.phantomx_ramp(body.state) == 0.0


def changes(rows):
    return [rows[0]] + [b for a, b in pairwise(rows) if a[1] != b[1]]
