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
