"""An emulated robot's body, looked at at any moment."""

import numpy as np
import pytest

from bns.hardware.emulators.khepera import KheperaBody

SPEED = 0.1  # m/s


def test_a_picture_shows_the_moment_and_not_the_nearest_physics_step():
    body = KheperaBody()
    body.tell(0.0, -SPEED, SPEED)
    body.advance(1.5)
    moments = 1.0 + np.arange(40) * body.dt / 8
    yaws = np.array([body.pose(at)[2] for at in moments])
    rate = np.diff(yaws) / np.diff(moments)
    assert rate == pytest.approx(np.full(39, rate.mean()), rel=0.05)
    assert rate.mean() > 1.5  # it turns


def test_a_moment_ahead_of_the_physics_is_reached_by_going_straight_on():
    body = KheperaBody()
    body.tell(0.0, SPEED, SPEED)
    body.advance(1.0 + 1e-6)
    ahead = 1.0 + 0.6 * body.dt
    seen = body.pose(ahead)
    body.advance(1.5)
    assert seen[0] == pytest.approx(body.pose(ahead)[0], abs=1e-6)
    assert body.pose(0.0)[0] == pytest.approx(0.0, abs=1e-4)


def test_the_attitude_stays_a_rotation_between_steps():
    body = KheperaBody()
    body.tell(0.0, -SPEED, SPEED)
    body.advance(1.0)
    for at in (0.5001, 0.5023):
        assert np.linalg.norm(body.attitude(at)[1:]) == pytest.approx(1.0, abs=1e-4)
