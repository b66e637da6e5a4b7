"""How trials of a log begin, guessed from the log and the model."""

import mujoco
import numpy as np
import pytest

from bns.gap.models.mjcf import command_steps, guesses
from tests.gap.own_robots import described

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
