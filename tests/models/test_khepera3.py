"""Facts of the Khepera III: where its sensors look, what its device units mean."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import UnknownNameError
from bns.models import khepera3
from bns.models.khepera3 import COMMAND, FIRMWARES, drive, firmware

FRONT = {
    "public": (76.7, 42.8, 13.3, -13.3, -42.8, -76.7),
    "thesis": (85.0, 45.0, 10.0, -10.0, -45.0, -85.0),
}


def looks(**options) -> dict[str, np.ndarray]:
    """Direction of each infrared sensor in the robot's frame, at home."""
    model = models.spec("khepera3", **options).compile()
    data = mujoco.MjData(model)
    mujoco.mj_resetDataKeyframe(model, data, 0)
    mujoco.mj_forward(model, data)
    sites = models.robot("khepera3").sensor_sites
    return {site: data.site(site).xmat.reshape(3, 3)[:, 2] for site in sites}


@pytest.mark.parametrize("table", FRONT)
def test_front_sensors_look_where_the_table_says(table):
    front = list(looks(ir_table=table).values())[1:7]
    headings = [np.degrees(np.arctan2(look[1], look[0])) for look in front]
    np.testing.assert_allclose(headings, FRONT[table], atol=1e-9)
    assert np.abs([look[2] for look in front]).max() < 1e-12


def test_public_table_is_the_default_and_tables_share_the_rest():
    given, public, thesis = looks(), looks(ir_table="public"), looks(ir_table="thesis")
    for site in given:
        np.testing.assert_allclose(given[site], public[site], atol=1e-12)
    for site in ("ir_back_left", "ir_back", "ir_ground_left", "ir_ground_right"):
        np.testing.assert_array_equal(public[site], thesis[site])


def test_ground_sensors_look_down_and_eleven_there_are():
    seen = looks()
    assert len(seen) == 11
    np.testing.assert_allclose(seen["ir_ground_left"], [0, 0, -1], atol=1e-12)


def test_sensors_are_mirror_images():
    model = models.spec("khepera3").compile()
    for pair in ("left_90", "left_45", "front_left", "back_left", "ground_left"):
        left = model.site(f"ir_{pair}").pos
        right = model.site(f"ir_{pair.replace('left', 'right')}").pos
        np.testing.assert_allclose(left * [1, -1, 1], right)


def test_units_before_3_are_the_manuals():
    old = firmware("before-3")
    assert old.speed(20000) == pytest.approx(0.1389, abs=5e-5)  # manual 2.2, p. 14
    assert old.distance(1) == pytest.approx(0.0466e-3, abs=5e-8)  # p. 36
    assert old.encoder(0.041 * np.pi) == pytest.approx(2764.8)


def test_units_from_3_differ_by_half():
    old, new = FIRMWARES["before-3"], FIRMWARES["from-3"]
    assert old.speed(17500) / new.speed(17500) == pytest.approx(1.52, abs=0.005)
    assert new.distance(1) == pytest.approx(0.0307e-3, abs=5e-8)


@pytest.mark.parametrize("name", FIRMWARES)
def test_units_turn_back(name):
    units = firmware(name)
    assert units.units(units.speed(17500)) == pytest.approx(17500)
    assert units.encoder(units.distance(1234)) == pytest.approx(1234)
    assert units.angle(units.counts) == pytest.approx(2 * np.pi)


def test_the_robots_answer_names_the_firmware():
    assert [firmware(v).name for v in (1, 2, 3, 4)] == [
        *["before-3"] * 2,
        *["from-3"] * 2,
    ]


@pytest.mark.parametrize("unknown", ["", "3", "2.2", 0, -1, True, None])
def test_unknown_firmware_is_refused(unknown):
    with pytest.raises(UnknownNameError, match="before-3, from-3"):
        firmware(unknown)


@pytest.fixture(scope="module")
def model():
    return models.spec("khepera3").compile()


@pytest.fixture(scope="module")
def measured():
    return khepera3.measure(models.spec("khepera3"))


def test_steady_speed_is_the_laboratorys(measured):
    assert measured.speed == pytest.approx(0.1214, rel=0.03)  # m/s


def test_spin_is_the_laboratorys(measured):
    assert np.degrees(measured.spin) == pytest.approx(159.3, rel=0.03)


def test_starting_from_rest_loses_the_laboratorys_way(measured):
    assert measured.lost_distance == pytest.approx(0.0165, rel=0.10)  # m


def test_starting_to_spin_loses_the_laboratorys_angle(measured):
    assert np.degrees(measured.lost_angle) == pytest.approx(11, rel=0.10)


def test_deviations_are_shares_of_what_is_allowed():
    off = khepera3.TARGET._replace(speed=0.1214 * 0.985)
    shares = khepera3.deviations(off)
    assert shares["speed"] == pytest.approx(0.5)
    assert shares["spin"] == 0


def test_a_slack_servo_is_noticed():
    spec = models.spec("khepera3")
    for actuator in spec.actuators:
        actuator.gainprm[0] /= 2
        actuator.biasprm[2] /= 2
    assert khepera3.deviations(khepera3.measure(spec))["lost_distance"] > 1


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
