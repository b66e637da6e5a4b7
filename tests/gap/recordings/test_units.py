"""Units of columns and of what actuators are told, and channels without them."""

import numpy as np
import pytest

from bns.gap.describe import describe
from bns.gap.models.mjcf import matching
from tests.gap.own_robots import ARM


def written(folder, servos, head, columns):
    """A description of the arm with other actuators, from a short log."""
    (folder / "arm.xml").write_text(ARM.replace("ACTUATORS", servos))
    table = np.column_stack([np.arange(len(columns[0])) * 0.01, *columns])
    np.savetxt(folder / "log.csv", table, delimiter=",", header=head, comments="")
    return describe(folder / "arm.xml", folder / "log.csv")


SWAY = np.sin(np.arange(0, 4, 0.01))


def test_a_goal_told_to_a_loop_of_speed_needs_no_gains(tmp_path):
    servos = '<velocity name="hip" joint="FL_hip_joint" kv="5"/>'
    found = written(tmp_path, servos, "time,hip_goal,hip,calf", [SWAY, SWAY, 0 * SWAY])
    assert "told to actuator 'hip' in rad/s" in " ".join(found.guessed)


def test_a_speed_told_in_turns_a_minute_is_converted_under_a_name_without_them(
    tmp_path,
):
    servos = '<velocity name="hip" joint="FL_hip_joint" kv="5"/>'
    names = "time,hip_rpm_cmd,hip_deg,calf_rad"
    found = written(tmp_path, servos, names, [30 * SWAY, 20 * SWAY, 0 * SWAY])
    assert "hip_rpm_cmd: told to actuator 'hip' in rpm" in " ".join(found.guessed)
    for line in (
        '[commands."hip_cmd"]',
        '[observed."hip"]',
        '"hip_cmd" = { column = "hip_rpm_cmd", unit = "rpm" }',
        '"hip" = { column = "hip_deg", unit = "deg" }',
    ):
        assert line in found.toml
    assert '[observed."calf_rad"]' in found.toml


def test_two_columns_that_units_tell_apart_keep_them(tmp_path):
    servos = '<velocity name="hip" joint="FL_hip_joint" kv="5"/>'
    head = "time,hip_cmd,hip_deg,hip_rpm"
    found = written(tmp_path, servos, head, [SWAY, 20 * SWAY, 10 * SWAY])
    for name in ("hip_deg", "hip_rpm"):
        assert f'[observed."{name}"]' in found.toml


def test_an_angle_called_as_a_body_is_no_place(tmp_path):
    servos = '<velocity name="hip" joint="FL_hip_joint" kv="5"/>'
    found = written(tmp_path, servos, "time,hip_cmd,upper_deg", [SWAY, 20 * SWAY])
    assert "body = " not in found.toml and 'joint = "FL_hip_joint"' in found.toml


@pytest.mark.parametrize(
    ("name", "plain"),
    [
        ("elbow_deg", "elbow"),
        ("elbow [deg]", "elbow"),
        ("left_rpm_cmd", "left_cmd"),
        ("elbow_vel_rad_s", "elbow_vel"),
        ("elbow", "elbow"),
        ("deg", "deg"),
    ],
)
def test_a_name_without_its_unit(name, plain):
    assert matching.unitless(name) == plain


def test_the_goal_of_a_tendon_of_hinges_is_an_angle(tmp_path):
    both = "".join(
        f'<joint joint="FL_{name}_joint" coef="1"/>' for name in ("hip", "calf")
    )
    tendon = f'<tendon><fixed name="both">{both}</fixed></tendon>'
    servos = '<position name="pull" tendon="both" kp="9"/></actuator>' + tendon
    head = "time,pull_goal,hip,calf"
    servos += "<actuator>"
    found = written(tmp_path, servos, head, [SWAY, SWAY, 0 * SWAY])
    assert "told to actuator 'pull' in rad" in " ".join(found.guessed)
