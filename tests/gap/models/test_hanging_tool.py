"""A slide with a tool that hangs on it, whose swing nobody observes but by its tip."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bns.gap.candidates import mjcf_usual
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import start
from bns.gap.models.mjcf.model import OwnModel
from tests.gap.own_robots import described

MOTOR = '<geom type="box" size=".1 .1 .05" mass="1"/>'
CARRIED = """<geom type="box" size=".05 .05 .05" mass="3"/><body name="tool">
  <joint name="swing" axis="0 1 0" damping="0.002"/>
  <geom type="sphere" pos="0 0 -.15" size=".02" mass="0.2"/>
  <site name="tip" pos="0 0 -.17"/></body>"""
PLAY = """<body name="carriage"><joint name="play" type="slide" axis="1 0 0"
  range="-.003 .003" limited="true" damping="3" solreflimit="0.004 1"/>"""
SLIDE = """<mujoco model="slide"><option timestep="0.002" integrator="implicitfast"/>
  <default><geom contype="0" conaffinity="0"/></default>
  <worldbody><body name="bridge" pos="0 0 1"><joint name="rail" type="slide"
  axis="1 0 0" damping="10" frictionloss="2" armature="0.5"/>{}</body></worldbody>
  <actuator><position name="servo" joint="rail" kp="4000" kv="150"/></actuator></mujoco>
"""
TRIED = ("joint_backlash", "output_backlash", "joint_damping")
NOISE = (3e-5, 3e-5, 4e-4)


@pytest.fixture
def swinging(tmp_path):
    """The model and trials of a recording of 24 s at 100 Hz; of a real one with play of
    6 mm between the motor and the scale that is read, or none."""

    def run(played: bool) -> tuple[OwnModel, list]:
        with_play = MOTOR + PLAY + CARRIED + "</body>"
        real = mujoco.MjModel.from_xml_string(
            SLIDE.format(with_play if played else MOTOR + CARRIED)
        )
        real.opt.timestep = 0.001
        data, rng = mujoco.MjData(real), np.random.default_rng(5)
        lines = ["time,servo_cmd,rail_pos,tip_x,tip_z"]
        for sample in range(2400):
            time = sample / 100
            goal = round(0.1 * np.sin(2.2 * time + 0.03 * time**2), 4)
            mujoco.mj_forward(real, data)
            rail = data.qpos[0] + (data.joint("play").qpos[0] if played else 0.0)
            tip = data.site("tip").xpos
            seen = np.array([rail, tip[0], tip[2]]) + NOISE * rng.normal(size=3)
            lines.append(",".join(f"{cell:.6g}" for cell in (time, goal, *seen)))
            data.ctrl[0] = goal
            mujoco.mj_step(real, data, 10)
        (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
        _, model = described(
            tmp_path, SLIDE.format(MOTOR + CARRIED), tmp_path / "log.csv"
        )
        model = OwnModel(
            replace(
                model.config,
                effects={name: ("rail",) for name in TRIED},
            ),
            threads=1,
        )
        return model, model.read_log(str(tmp_path / "log.csv"))

    return run


def test_what_nobody_observed_begins_a_piece_as_the_model_moves_it(swinging):
    model, trials = swinging(played=False)
    assert len(trials) == 8
    (paths,) = model.paths(trials, [[{}] * len(trials)])
    for trial, path in zip(trials, paths, strict=True):
        apart = (trial.observed - path)[:, 1]
        assert np.sqrt(np.mean(apart**2)) < 3e-3  # the tip swings by 0.1 m
    for trial in trials[1:]:
        assert trial.conditions[start.UNSURE]["swing"][0] > 0.01
    assert "start_speed[swing]" in model.begun(trials[1])
    assert diagnose(trials, model, full=False).verdict.kind == "no gap"


def test_what_has_no_name_begins_at_rest(swinging, monkeypatch):
    carried = CARRIED.replace(' name="swing"', "")
    monkeypatch.setitem(swinging.__globals__, "CARRIED", carried)
    _, trials = swinging(played=False)
    assert trials[1].conditions[start.UNSURE].keys() == {"rail"}


def test_play_before_the_encoder_of_a_position_servo_is_found(swinging):
    model, trials = swinging(played=True)
    assert set(TRIED) <= set(mjcf_usual.usual(model.config, model.physics.model))
    found = diagnose(trials, model, full=False)
    assert found.verdict.named == (("output_backlash[rail]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.006, rel=0.05)
