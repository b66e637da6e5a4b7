"""How trials of a log begin, guessed from the log and the model."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bns.gap.bench import mjcf_cases
from bns.gap.models.mjcf import command_steps, guesses, ties
from bns.gap.models.mjcf.model import OwnModel
from tests.gap.own_robots import MOTORS, arm, described, of_motors

SLIDE = """<body><joint name="{name}" type="slide" axis="0 0 1" damping="{damping}"
  stiffness="{stiffness}"/><geom size="0.05" mass="1" contype="0"
  conaffinity="0"/></body>"""
PENDULUM = """<mujoco><option timestep="0.005"/><worldbody><body name="bob">
  <joint name="swing" axis="0 1 0" damping="0.05"/>
  <geom type="sphere" size="0.05" pos="0 0 -0.4" mass="0.5"/></body></worldbody>
  <actuator><motor name="motor" joint="swing" ctrlrange="-2 2"/></actuator></mujoco>"""


@pytest.mark.parametrize(
    ("slides", "lasting"),
    [
        ([(30.0, 100.0)], 2.0),  # comes to rest
        ([(30.0, 100.0), (3000.0, 0.0)], 1.0),  # the other creeps by 1.6 mm in 0.5 s
        ([(30.0, 100.0), (300.0, 0.0)], guesses.SETTLE),  # goes on by 16 mm
    ],
)
def test_a_model_settles_until_it_hardly_moves(slides, lasting):
    bodies = "".join(
        SLIDE.format(name=f"j{n}", damping=d, stiffness=k)
        for n, (d, k) in enumerate(slides)
    )
    text = f"<mujoco><worldbody>{bodies}</worldbody></mujoco>"
    model = mujoco.MjModel.from_xml_string(text)
    assert guesses.settling(model, "") == pytest.approx(lasting)


@pytest.mark.parametrize("away", [0.0, 0.04])
def test_trials_that_begin_in_various_places_begin_where_recorded(tmp_path, away):
    model = mujoco.MjModel.from_xml_string(PENDULUM)
    rng, rows = np.random.default_rng(1), []
    for trial in range(4):
        data = mujoco.MjData(model)
        data.qpos[0] = away * (-1) ** trial
        for number in range(200):
            data.ctrl[0] = [0.5, -0.8, 0.2, 1.0][number // 50]
            seen = rng.normal(data.qpos[0], 1e-3)
            rows.append([trial, number * 0.01, data.ctrl[0], seen])
            mujoco.mj_step(model, data, 2)
    log = tmp_path / "log.csv"
    head = "trial,time,motor_cmd,swing"
    np.savetxt(log, rows, delimiter=",", header=head, comments="")
    found, own = described(tmp_path, PENDULUM, log)
    assert own.config.recorded == bool(away)
    assert "start: at rest" in " ".join(found.guessed)


def hung(tilt, servo):
    """A pendulum that is turned by a motor, or held by a servo, on a tilted base."""
    drive = '<position name="motor" joint="swing" kp="4" kv="0.4"/>' if servo else ""
    text = PENDULUM.replace(
        '<motor name="motor" joint="swing" ctrlrange="-2 2"/>', drive
    )
    return (text if servo else PENDULUM).replace(
        "<worldbody>", f'<option gravity="{9.81 * tilt} 0 -9.81"/><worldbody>'
    )


@pytest.mark.parametrize(
    ("servo", "tilt", "rested"),
    [(True, 0.0, False), (True, 0.05, True), (False, 0.01, False)],
)
def test_what_rested_elsewhere_than_its_model_had_come_to_rest(
    tmp_path, servo, tilt, rested
):
    model = mujoco.MjModel.from_xml_string(hung(tilt, servo))
    rng, rows = np.random.default_rng(1), []
    for trial in range(4):
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 20_000)
        for number in range(200):
            data.ctrl[0] = [0.0, -0.3, 0.2, 0.3][number // 50]
            rows.append([trial, number * 0.01, data.ctrl[0], data.qpos[0]])
            rows[-1][-1] += rng.normal(0, 1e-3)
            mujoco.mj_step(model, data, 2)
    log = tmp_path / "log.csv"
    head = "trial,time,motor_cmd,swing"
    np.savetxt(log, rows, delimiter=",", header=head, comments="")
    _, own = described(tmp_path, hung(0.0, servo), log)
    assert bool(own.config.settle) == rested  # what swings on had not


def test_what_stays_where_it_is_put_does_not_come_back():
    slide = SLIDE.format(name="free", damping=50.0, stiffness=0.0)
    model = mujoco.MjModel.from_xml_string(
        f'<mujoco><option gravity="0 0 0"/><worldbody>{slide}</worldbody></mujoco>'
    )
    assert guesses.returning(model, "", {"free": 0.01}) == 0.0
    assert guesses.returning(model, "", {}) == 0.0


def test_filters_begin_with_what_was_told_before():
    model = mujoco.MjModel.from_xml_string(
        PENDULUM.replace(
            '<motor name="motor" joint="swing" ctrlrange="-2 2"/>',
            '<general joint="swing" dyntype="filter" dynprm="0.1" ctrlrange="-2 2"/>',
        )
    )
    before = np.where(np.arange(200) < 180, 0.0, 5.0)[:, None]  # 2 is the most
    (found,) = command_steps.filtered(before, model, [0]).values()
    assert found == pytest.approx(2 * (1 - np.exp(-20 * 0.005 / 0.1)))


PENDULUMS = """<mujoco><option timestep="0.002"/><worldbody><body name="cart">
  <joint name="rail" type="slide" axis="1 0 0" damping="4"/>
  <geom size="0.05" mass="1" contype="0" conaffinity="0"/>
  <body name="mast" pos="0 0 0.05"><joint name="bend" axis="0 1 0" stiffness="6"
    damping="0.02" springref="8"/>
  <geom name="rod" type="capsule" fromto="0 0 0 0 0 0.4" size="0.01" mass="0.4"
    contype="0" conaffinity="0"/></body></body></worldbody>
  <actuator><velocity name="drive" joint="rail" kv="30"/></actuator></mujoco>"""


def put(path, seen=("rail",), count=4, away=0.03):
    """A log of the cart, put elsewhere before each trial; its mast had come to rest."""
    model = mujoco.MjModel.from_xml_string(PENDULUMS)
    rng, rows = np.random.default_rng(1), []
    for trial in range(count):
        data = mujoco.MjData(model)
        mujoco.mj_step(model, data, 20_000)
        data.qpos[0] = away * (-1) ** trial
        data.qvel[:] = 0.0
        for number in range(200):
            data.ctrl[0] = [0.0, -0.3, 0.2, 0.3][number // 50]
            at = rng.normal([data.joint(name).qpos[0] for name in seen], 1e-3)
            rows.append([trial, number * 0.01, data.ctrl[0], *at])
            mujoco.mj_step(model, data, 5)
    head = ",".join(("trial", "time", "drive_cmd", *seen))
    np.savetxt(path, rows, delimiter=",", header=head, comments="")
    return path


def test_a_robot_that_settles_begins_where_it_was_put(tmp_path):
    log = put(tmp_path / "log.csv", ("rail", "bend"))
    found, own = described(tmp_path, PENDULUMS, log)
    assert own.config.recorded and not own.config.settle
    assert "where its joints were recorded in each trial" in " ".join(found.guessed)


def test_joints_that_nobody_saw_hang_where_the_others_were_put(tmp_path):
    _, own = described(tmp_path, PENDULUMS, put(tmp_path / "log.csv"))
    (trial, *_) = own.read_log(str(tmp_path / "log.csv"))
    begun = own.physics.starts.stood(trial, 0.0, None)
    assert begun[0] == pytest.approx(trial.observed[0, 0])
    state = own.physics.starts.begun(trial, own.physics.model)
    angle = state[2]
    weight = 0.4 * 9.81 * 0.2 * np.sin(angle)  # leans on its spring
    assert 6.0 * (angle - np.deg2rad(8)) == pytest.approx(weight, abs=1e-4)


SWIMMER = """<mujoco><option timestep="0.005" viscosity="0.5" gravity="0 0 0"/>
  <worldbody><body name="head"><joint name="slide_x" type="slide" axis="1 0 0"/>
  <joint name="slide_y" type="slide" axis="0 1 0"/><joint name="turn" axis="0 0 1"/>
  <geom type="capsule" fromto="0 0 0 -0.2 0 0" size="0.02" mass="0.2"/>
  <body name="tail" pos="-0.2 0 0"><joint name="bend" axis="0 0 1" damping="0.01"/>
  <geom type="capsule" fromto="0 0 0 -0.2 0 0" size="0.02" mass="0.2"/></body></body>
  </worldbody><actuator><motor name="muscle" joint="bend"/></actuator></mujoco>"""


def test_a_place_that_is_a_slide_is_seen_as_that():
    model = mujoco.MjModel.from_xml_string(SWIMMER)
    assert ties.slides(model) == {("head", "x"): "slide_x", ("head", "y"): "slide_y"}
    for old, new in (
        ('name="head"', 'name="head" pos="0.1 0 0"'),  # another zero
        ('axis="1 0 0"', 'axis="-1 0 0"'),  # the other way
        ('axis="0 0 1"/>\n', 'axis="0 0 1" pos="0.1 0 0"/>\n'),  # turns it aside
    ):
        assert old in SWIMMER
        other = mujoco.MjModel.from_xml_string(SWIMMER.replace(old, new, 1))
        assert ("head", "x") not in ties.slides(other)


def test_robots_that_settle_alike_do_it_once_to_the_same_bytes(tmp_path, monkeypatch):
    robot = arm(tmp_path, MOTORS, of_motors('joint_damping = ["FL_calf_joint"]'))
    physics = OwnModel(replace(robot.config, settle=0.2), threads=1).physics
    told = mjcf_cases.commands(robot, np.random.default_rng(0), 3)
    trials = mjcf_cases.record(robot, told, [])
    lead = physics._lead(physics.dt)
    jobs = [physics._job(trial, (), 1) for trial in trials]
    lost = jobs[0]._replace(start=jobs[0].start + 1e12)
    whole = physics._pool.map([*jobs, lost])
    asked, run = [], physics._pool.map
    monkeypatch.setattr(
        physics._pool, "map", lambda jobs: (asked.append(len(jobs)), run(jobs))[1]
    )
    made = physics._settled([*jobs, lost], lead)
    assert asked == [2, len(jobs)]  # what diverges does so by itself
    for motion, states in zip(whole[:-1], made[:-1], strict=True):
        np.testing.assert_array_equal(states, motion.states[lead:])
    assert whole[-1].diverged >= 0 and np.isnan(made[-1]).all()
