"""Gyros of a model: which columns are theirs, what they read, what is found of them."""

import mujoco
import numpy as np
import pytest

from bns.errors import FormatError, UnknownNameError
from bns.gap.diagnose import diagnose
from bns.gap.importers.tables import Column
from bns.gap.models.mjcf import inertial
from tests.gap.own_robots import described

HEAD = """<mujoco><option timestep="0.002"/><worldbody><body>
  <joint name="pan" axis="0 0 1" damping="0.05" armature="0.01"/>
  <geom size="0.05" mass="0.5" contype="0" conaffinity="0"/>
  <body pos="0 0 0.1"><joint name="tilt" axis="0 1 0" damping="0.05" armature="0.01"/>
  <geom size="0.05" mass="0.5" contype="0" conaffinity="0"/>
  <site name="imu" euler="0 0 90"/></body></body></worldbody>
  <actuator><motor name="pan_motor" joint="pan"/>
  <motor name="tilt_motor" joint="tilt"/></actuator>
  <sensor><gyro name="imu_gyro" site="imu"/></sensor></mujoco>"""
HEADER = "trial,time,pan_motor_cmd,tilt_motor_cmd,pan,tilt,imu_gx,imu_gy,imu_gz,imu_ax"


def column(name):
    return Column(name, np.zeros(3))


@pytest.mark.parametrize(
    ("name", "axis"),
    [
        ("imu_gyro_x", "x"),
        ("imu_gy", "y"),
        ("gyro.z", "z"),
        ("gyro_z_dps", "z"),
        ("imu_angular_velocity_y", "y"),
    ],
)
def test_columns_are_known_by_their_names(name, axis):
    (parts,) = inertial.rates([column(name)], ["imu_gyro"]).values()
    assert [(part.name, part.axis) for part in parts] == [("imu_gyro", axis)]
    assert inertial.rates([column(name)], []) == {name: ()}


def test_the_gyro_that_is_called_so_is_taken_of_several():
    made = inertial.rates([column("head_gyro_x")], ["base_gyro", "head_gyro"])
    assert made["head_gyro_x"][0].name == "head_gyro"


def test_other_columns_are_none_of_an_inertial_unit():
    names = ("gx", "base_x", "wx", "imu_temp", "accelerator_x", "elbow_vel")
    columns = [column(name) for name in names]
    assert not inertial.rates(columns, ["imu_gyro"])
    assert not inertial.accelerations(columns)
    assert inertial.accelerations([column("imu_ax"), column("acc_y")])


def recorded(path, scale=1.0, noise=0.003):
    """A log of the head; its gyro reads so much of the rate."""
    model = mujoco.MjModel.from_xml_string(HEAD)
    rng, rows = np.random.default_rng(1), []
    for trial in range(4):
        data, told = mujoco.MjData(model), rng.uniform(-0.04, 0.04, (20, 2))
        for number in range(200):
            data.ctrl[:] = told[number // 10]
            mujoco.mj_forward(model, data)
            seen = rng.normal([*data.qpos, *(scale * data.sensordata)], noise)
            rows.append([trial, number * 0.01, *data.ctrl, *seen, 0.1 * number % 1])
            mujoco.mj_step(model, data, 5)
    np.savetxt(path, rows, delimiter=",", header=HEADER, comments="")
    return path


def test_a_gyro_is_read_as_the_model_has_it(tmp_path):
    found, own = described(tmp_path, HEAD, recorded(tmp_path / "log.csv", noise=1e-5))
    assert [item.quantity for item in own.config.seen] == ["joint"] * 2 + ["gyro"] * 3
    assert "left out, for no acceleration is compared: imu_ax" in found.guessed
    trials = own.read_log(str(tmp_path / "log.csv"))
    made = own.simulate(trials, [()])[0]
    for trial, seen in zip(trials, made, strict=True):
        np.testing.assert_allclose(seen, trial.observed, atol=3e-3)


@pytest.mark.parametrize("scale", [1.0, 0.9])
def test_the_scale_of_a_gyro_is_found(tmp_path, scale):
    log = recorded(tmp_path / "log.csv", scale)
    _, own = described(tmp_path, HEAD, log)
    found = diagnose(own.read_log(str(log)), own, full=False)
    if scale == 1.0:
        assert found.verdict.kind == "no gap"
        return
    assert found.verdict.named == (("reading_gain[imu_g*]",),)
    assert found.best.magnitudes == pytest.approx([scale], abs=0.005)


@pytest.mark.parametrize(
    ("line", "error", "says"),
    [
        ('gyro = "tilt"', UnknownNameError, "imu_gyro"),
        ('gyro = "imu_gyro"\naxis = "yaw"', UnknownNameError, "x, y, z"),
        ('gyro = "imu_gyro"\nunit = "rad"', FormatError, "rad/s"),
    ],
)
def test_a_gyro_that_cannot_be_is_refused(tmp_path, line, error, says):
    _, own = described(tmp_path, HEAD, recorded(tmp_path / "log.csv"))
    text = (tmp_path / "own.toml").read_text()
    old = 'gyro = "imu_gyro"\naxis = "x"\nunit = "rad/s"'
    assert old in text
    line += "" if "unit" in line else '\nunit = "rad/s"'
    (tmp_path / "own.toml").write_text(text.replace(old, line))
    with pytest.raises(error, match=says):
        type(own).read(tmp_path / "own.toml")
