"""Facts of the Khepera III: where its sensors look, what its device units mean."""

import mujoco
import numpy as np
import pytest

from bns import models
from bns.errors import UnknownNameError
from bns.models.khepera3.units import FIRMWARES, firmware

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
