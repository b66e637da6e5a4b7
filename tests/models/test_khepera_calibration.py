"""The Khepera III model drives like the laboratory's robot."""

import numpy as np
import pytest

from bns import models
from bns.models.khepera3 import calibration
from bns.models.khepera3.calibration import COMMAND, drive


@pytest.fixture(scope="module")
def model():
    return models.spec("khepera3").compile()


@pytest.fixture(scope="module")
def measured():
    return calibration.measure(models.spec("khepera3"))


def test_steady_speed_is_the_laboratorys(measured):
    assert measured.speed == pytest.approx(0.1214, rel=0.03)  # m/s


def test_spin_is_the_laboratorys(measured):
    assert np.degrees(measured.spin) == pytest.approx(159.3, rel=0.03)


def test_starting_from_rest_loses_the_laboratorys_way(measured):
    assert measured.lost_distance == pytest.approx(0.0165, rel=0.10)  # m


def test_starting_to_spin_loses_the_laboratorys_angle(measured):
    assert np.degrees(measured.lost_angle) == pytest.approx(11, rel=0.10)


def test_deviations_are_shares_of_what_is_allowed():
    off = calibration.TARGET._replace(speed=0.1214 * 0.985)
    shares = calibration.deviations(off)
    assert shares["speed"] == pytest.approx(0.5)
    assert shares["spin"] == 0


def test_a_slack_servo_is_noticed():
    spec = models.spec("khepera3")
    for actuator in spec.actuators:
        actuator.gainprm[0] /= 2
        actuator.biasprm[2] /= 2
    assert calibration.deviations(calibration.measure(spec))["lost_distance"] > 1


def test_straight_is_straight(model):
    end = drive(model, COMMAND, COMMAND, seconds=9.0)[-1]
    assert end[0] > 1.0
    assert abs(end[1]) < 1e-3  # m of lateral drift on more than a metre


def test_left_and_right_are_mirror_images(model):
    left = drive(model, COMMAND / 2, COMMAND)
    right = drive(model, COMMAND, COMMAND / 2)
    np.testing.assert_allclose(left * [1, -1, -1], right, atol=1e-9)


def test_it_backs_up_as_fast_as_it_drives(model):
    ahead, back = drive(model, COMMAND, COMMAND), drive(model, -COMMAND, -COMMAND)
    assert back[-1, 0] == pytest.approx(-ahead[-1, 0], rel=1e-3)


def test_it_comes_to_rest(model):
    import mujoco

    data = mujoco.MjData(model)
    data.ctrl[:] = COMMAND / 0.0205
    for _ in range(400):
        mujoco.mj_step(model, data)
    moving = np.linalg.norm(data.qvel[:3])
    data.ctrl[:] = 0
    for _ in range(400):
        mujoco.mj_step(model, data)
    assert moving > 0.12
    assert np.linalg.norm(data.qvel[:3]) < 1e-5  # m/s


def test_the_fastest_reversal_does_not_tip_it(model):
    import mujoco

    data = mujoco.MjData(model)
    for step in range(800):
        data.ctrl[:] = 14.566 * (1 if step // 200 % 2 else -1)
        mujoco.mj_step(model, data)
        up = data.body("khepera3").xmat[8]
        assert up > np.cos(np.radians(2))
