"""Robots of others: a wheel seen by its speed alone, a table that leans, linkages."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bns.gap.candidates import mjcf
from bns.gap.diagnose import diagnose
from bns.gap.models.mjcf import start, ties
from bns.gap.models.mjcf.model import OwnModel
from bns.gap.records import Diagnosis, Fit, Verdict
from bns.gap.warnings import warnings
from tests.gap.own_robots import described

FLYWHEEL = """<mujoco model="flywheel"><option timestep="0.004" integrator="RK4"/>
  <worldbody><body name="rod" pos="0 0 1">
    <joint name="swing" axis="0 1 0" damping="0.015"/>
    <geom type="cylinder" fromto="0 0 0 0 0 -0.28" size="0.02" mass="0.34"
      contype="0" conaffinity="0"/>
    <body name="wheel" pos="0 0.03 -0.28">
      <joint name="spin" axis="0 1 0" damping="0.0006"/>
      <geom type="cylinder" size="0.07 0.006" euler="1.5708 0 0" mass="0.3"
        contype="0" conaffinity="0"/></body></body></worldbody>
  <actuator><motor name="turn" joint="spin"/></actuator></mujoco>"""


@pytest.fixture
def spun(tmp_path):
    """The model and trials of a log of 15 s of a flywheel on a pendulum."""
    model = mujoco.MjModel.from_xml_string(FLYWHEEL)
    model.opt.timestep = 0.001
    data, rng = mujoco.MjData(model), np.random.default_rng(0)
    lines = ["time,torque_cmd_Nm,phi_deg,wheel_rpm"]
    for sample in range(1500):
        at = sample / 100
        data.ctrl[0] = 0.15 * np.sin(5 * at) + 0.1 * np.sign(np.sin(1.7 * at))
        seen = (
            np.degrees(data.qpos[0]) + rng.normal(0, 0.05),
            data.qvel[1] * 30 / np.pi + rng.normal(0, 1.0),
        )
        cells = (at, data.ctrl[0], *seen)
        lines.append(",".join(f"{cell:.6g}" for cell in cells))
        mujoco.mj_step(model, data, 10)
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    _, own = described(tmp_path, FLYWHEEL, tmp_path / "log.csv")
    return own, own.read_log(str(tmp_path / "log.csv"))


def test_a_joint_seen_by_its_speed_alone_begins_with_it(spun):
    own, trials = spun
    parts = {item.channel.name: (item.quantity, item.part) for item in own.config.seen}
    assert sorted(parts.values()) == [("joint", "swing"), ("speed", "spin")]
    assert len(trials) > 3
    fast = [abs(trial.conditions[start.STATE]["spin"][1]) for trial in trials]
    assert max(fast) > 20  # rad/s
    assert all("start_position[spin]" not in own.begun(trial) for trial in trials)
    (made,) = own.simulate(trials, [()])
    noise = np.array([item.noise for item in own.config.seen])
    for trial, path in zip(trials, made, strict=True):
        off = (trial.observed - path) / noise
        assert np.sqrt(np.nanmean(off**2, axis=0)).max() < 4


PUCK = """<mujoco model="puck"><option timestep="0.002"/>
  <worldbody><body name="table"><geom type="box" size="1 1 0.01" pos="0 0 -0.1"
      contype="0" conaffinity="0"/>
    <body name="puck"><joint name="slide" type="slide" axis="1 0 0" damping="0.05"/>
      <geom type="cylinder" size="0.05 0.01" mass="0.5" contype="0" conaffinity="0"/>
    </body></body></worldbody>
  <actuator><motor name="push" joint="slide"/></actuator></mujoco>"""


def logged(folder, model, *, span, commands, samples, noise):
    """Write a log of six trials at 50 Hz of a model with one joint and one actuator.

    Args:
        folder: where `log.csv` is written.
        model: the robot, at steps of 0.5 ms.
        span: commands are drawn up to so much either way.
        commands: of a trial.
        samples: that each lasts.
        noise: of the measurement.
    """
    rng = np.random.default_rng(1)
    lines = [f"time,{model.actuator(0).name},{model.joint(0).name},trial"]
    for trial in range(6):
        data, told = mujoco.MjData(model), rng.uniform(-span, span, commands).round(2)
        for sample in range(commands * samples):
            data.ctrl[0] = told[sample // samples]
            seen = data.qpos[0] + rng.normal(0, noise)
            lines.append(f"{sample / 50:.3f},{data.ctrl[0]},{seen:.5f},{trial}")
            mujoco.mj_step(model, data, 40)
    (folder / "log.csv").write_text("\n".join(lines) + "\n")


@pytest.mark.parametrize(("lean", "named"), [(0.0, False), (0.006, True)])
def test_a_table_that_leans_six_times_as_far_as_tables_do_is_a_gap(
    tmp_path, lean, named
):
    model = mujoco.MjModel.from_xml_string(PUCK)
    model.opt.timestep = 0.0005
    model.opt.gravity[0] = 9.81 * lean
    logged(tmp_path, model, span=0.4, commands=6, samples=25, noise=0.0015)
    _, own = described(tmp_path, PUCK, tmp_path / "log.csv")
    found = diagnose(own.read_log(str(tmp_path / "log.csv")), own, full=False)
    assert list(found.best.names) == (["body_tilt.pitch[table]"] if named else [])


def test_of_few_readings_each_may_be_late_of_many_a_camera_beside_encoders(spun):
    own, _ = spun

    def late(seen) -> list[str]:
        config = replace(own.config, seen=seen)
        made = mjcf.candidates(config, own.physics.model)
        assert "command_delay" in {row.effect for row in made}
        return [r.fixed["part"] for r in made if r.effect == "reading_delay"]

    joints = own.config.seen
    assert late(joints) == [item.channel.name for item in joints]
    assert late(joints[:1]) == []
    place = replace(joints[0], quantity="body", part="wheel", axis=0)
    assert late((*joints * 3, place)) == [place.channel.name]


def test_a_magnitude_at_the_end_of_its_range_is_pointed_out(spun):
    own, _ = spun
    plain = dict(magnitudes=(0.7,), intervals=((0.6, 0.7),), units=("kg",))
    nothing = Fit((), (), (), (), (), 9.0, 9.0, 0.0, 9.0)
    for at_bound in ((), ("body_mass[rod]",)):
        fit = Fit(
            ("body_mass[rod]",), ("body_mass:part=rod,added=0.7",), **plain,
            loss=1.0, held_out=1.0, held_out_se=0.1, evidence=1.0, at_bound=at_bound,
        )  # fmt: skip
        other = replace(fit, names=("joint_damping[swing]",), at_bound=())
        named = (fit.names,)
        verdict = Verdict("effect", named, named, 0.0, 0.0, 1.0, (), 1.0, "it is heavy")
        fits = (fit, other, nothing)
        found = Diagnosis("flywheel", 4, (), verdict, fits, {}, {}, {}, {})
        said = " ".join(warnings(found, own.listed))
        assert ("body_mass[rod]: ends where its range does" in said) == bool(at_bound)


FOURBAR = """<mujoco><worldbody>
    <body name="crank"><joint name="crank" axis="0 -1 0"/>
      <geom type="capsule" size="0.01" fromto="0 0 0 0.08 0 0"/></body>
    <body name="rocker" pos="0.25 0 0"><joint name="rocker" axis="0 -1 0"/>
      <geom type="capsule" size="0.01" fromto="0 0 0 0.08 0 0"/></body>
    <body name="ball" pos="0 1 0"><freejoint/><geom size="0.05"/></body></worldbody>
  {tie}
  <actuator><velocity name="motor" joint="crank"/></actuator></mujoco>"""
TIES = {
    "none": "",
    "bodies": '<equality><connect body1="crank" body2="rocker" anchor="0.1 0 0"/>'
    "</equality>",
    "joints": '<equality><joint joint1="crank" joint2="rocker"/></equality>',
    "tendon": '<tendon><fixed><joint joint="crank" coef="1"/><joint joint="rocker" '
    'coef="-1"/></fixed></tendon>',
}


@pytest.mark.parametrize("tie", TIES)
def test_what_is_tied_to_a_driven_part_moves_with_it(tie):
    model = mujoco.MjModel.from_xml_string(FOURBAR.format(tie=TIES[tie]))
    crank, rocker = model.body("crank").id, model.body("rocker").id
    wanted = {crank} if tie == "none" else {crank, rocker}
    assert ties.tied(model, {crank}) == wanted


PUSHER = """name = "pusher"
model = "pusher.xml"
[commands.speed]
actuator = "motor"
unit = "rad/s"
low = -1.0
high = 1.0
[observed.crank]
joint = "crank"
unit = "rad"
noise = 0.001
{ball}[log]
time = "t"
speed = "speed"
crank = "crank"
"""
BALL = '[observed.ball]\nbody = "ball"\naxis = "x"\nunit = "m"\nnoise = 0.001\n'


@pytest.mark.parametrize("ball", ["", BALL])
def test_what_is_pushed_about_is_considered_where_it_is_seen(ball, tmp_path):
    (tmp_path / "pusher.xml").write_text(FOURBAR.format(tie=""))
    text = PUSHER.format(ball=ball) + ('ball = "ball"\n' if ball else "")
    (tmp_path / "pusher.toml").write_text(text)
    own = OwnModel.read(tmp_path / "pusher.toml", threads=1)
    names = [item.name for item in mjcf.candidates(own.config, own.physics.model)]
    assert ("body_mass[ball]" in names) == bool(ball)
    assert "body_mass[crank]" in names
    assert "body_mass[rocker]" not in names


LIFT = """<mujoco model="lift"><option timestep="0.002"/>
  <worldbody><body name="plate"><joint name="rail" type="slide" axis="1 0 0"
      damping="2"/><geom size="0.05" mass="0.8" contype="0" conaffinity="0"/>
    </body></worldbody>
  <actuator><position name="drive" joint="rail" kp="120" kv="12"/></actuator>
  </mujoco>"""


def test_a_stop_that_the_model_does_not_know_is_found_where_it_is(tmp_path):
    model = mujoco.MjModel.from_xml_string(
        LIFT.replace('axis="1 0 0"', 'axis="1 0 0" limited="true" range="-1 0.12"')
    )
    model.opt.timestep = 0.0005
    logged(tmp_path, model, span=0.3, commands=4, samples=40, noise=0.001)
    _, own = described(tmp_path, LIFT, tmp_path / "log.csv")
    trials = own.read_log(str(tmp_path / "log.csv"))
    found = diagnose(trials, own, full=False)
    assert list(found.best.names) == ["joint_stop.high[rail]"]
    assert found.best.magnitudes[0] == pytest.approx(0.12, abs=0.003)
    alone = OwnModel(replace(own.config, effects={"joint_stop": ("rail",)}), threads=1)
    assert diagnose(trials, alone, full=False).best.names == found.best.names
    (stopped,) = own.simulate(trials, [tuple(map(own.parse, found.best.effects))])
    assert max(path.max() for path in stopped) == pytest.approx(
        max(np.nanmax(trial.observed) for trial in trials), abs=0.005
    )


@pytest.mark.parametrize("stiffness", [40.0, 1000.0])
def test_a_spring_that_is_met_on_the_way_is_found_with_where_it_begins(
    stiffness, tmp_path
):
    spring = f"""<tendon><fixed name="cable" stiffness="{stiffness}"
        springlength="-10 0.08"><joint joint="rail" coef="1"/></fixed></tendon>"""
    nominal = "</worldbody>"
    model = mujoco.MjModel.from_xml_string(LIFT.replace(nominal, nominal + spring))
    model.opt.timestep = 0.0005
    logged(tmp_path, model, span=0.3, commands=4, samples=40, noise=0.001)
    _, own = described(tmp_path, LIFT, tmp_path / "log.csv")
    found = diagnose(own.read_log(str(tmp_path / "log.csv")), own, full=False)
    assert list(found.best.names) == ["joint_bumper.above[rail]"]
    assert found.best.magnitudes[0] == pytest.approx(stiffness, rel=0.02)
    assert "N/m [" in found.verdict.sentence
    assert ", high 0.08" in found.verdict.sentence
    (effect,) = map(own.parse, found.best.effects)
    assert effect["high"] == pytest.approx(0.08, abs=0.001)


def test_a_limit_that_cuts_the_highest_peaks_alone_is_found(tmp_path):
    servo = '<position name="drive" joint="rail" kp="120" kv="12"'
    nominal = LIFT.replace(servo, f'{servo} forcerange="-200 200"')
    model = mujoco.MjModel.from_xml_string(LIFT)
    model.opt.timestep = 0.0005
    model.actuator_forcelimited[0], model.actuator_forcerange[0] = 1, (-25, 25)
    logged(tmp_path, model, span=0.3, commands=4, samples=40, noise=0.001)
    _, own = described(tmp_path, nominal, tmp_path / "log.csv")
    found = diagnose(own.read_log(str(tmp_path / "log.csv")), own, full=False)
    assert list(found.best.names) == ["actuator_torque_limit[drive]"]
    assert found.best.magnitudes[0] == pytest.approx(25 / 200, abs=0.01)


def test_a_clock_that_is_fast_is_named(tmp_path):
    model = mujoco.MjModel.from_xml_string(PUCK)
    model.opt.timestep = 0.0005 / 1.05  # 20 ms of the log are 19.05 ms
    logged(tmp_path, model, span=0.4, commands=6, samples=50, noise=0.0005)
    _, own = described(tmp_path, PUCK, tmp_path / "log.csv")
    trials = own.read_log(str(tmp_path / "log.csv"))
    assert ("log_clock[all]",) in diagnose(trials, own, full=False).verdict.named
    alone = OwnModel(replace(own.config, effects={"log_clock": ()}), threads=1)
    found = diagnose(trials, alone, full=False)
    assert found.best.magnitudes[0] == pytest.approx(0.05, abs=0.002)


def test_a_joint_that_hangs_still_moves_nothing_wherever_its_zero_is(spun):
    own, _ = spun
    seen = np.array([[2.0, 1.0], [2.0, np.nan], [2.0, 3.0]])
    moved = own.travelled(seen)
    assert moved[:, 0] == pytest.approx(0.0)
    assert moved[[0, 2], 1] == pytest.approx([-1.0, 1.0])
