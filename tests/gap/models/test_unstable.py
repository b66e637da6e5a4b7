"""A pole on a cart, which its commands alone do not hold upright; and lean models."""

from dataclasses import replace

import mujoco
import numpy as np
import pytest

from bns.gap.decomposition.reference import Corrected
from bns.gap.diagnose import diagnose
from bns.gap.models.base import GapModel
from bns.gap.models.mjcf import cuts, log, prepared
from bns.gap.models.mjcf.model import OwnModel
from tests.gap.own_robots import described

CART = """<mujoco model="cart"><option timestep="0.01" integrator="RK4"/>
  <visual><global offwidth="64"/></visual>
  <asset><texture name="sky" type="skybox" builtin="gradient" rgb1="0 0 1" rgb2="1 1 1"
      width="256" height="256"/>
    <texture name="grid" type="2d" builtin="checker" width="128" height="128"/>
    <material name="grey" texture="grid"/>
    <mesh name="hull" vertex="0 0 0 .1 0 0 0 .1 0 0 0 .1 .1 .1 .1"/></asset>
  <worldbody><body name="cart" pos="0 0 1">
    <joint name="rail" type="slide" axis="1 0 0" damping="0.5"/>
    <geom type="box" size="0.1 0.1 0.05" mass="1" material="grey"/>
    <geom type="mesh" mesh="hull" mass="0.2" contype="0" conaffinity="0"/>
    <body name="pole"><joint name="pivot" axis="0 1 0" damping="1e-4"/>
      <geom type="capsule" fromto="0 0 0 0 0 0.8" size="0.02" mass="0.1"
        contype="0" conaffinity="0"/></body></body></worldbody>
  <actuator><motor name="push" joint="rail" gear="10" ctrllimited="true"
    ctrlrange="-1 1"/></actuator></mujoco>"""
NOISE, RATE = 5e-4, 50


def recorded(path, friction=0.0, trials=5, seconds=3.0, gain=1.0):
    """A log at 50 Hz of a cart with dry friction [N], simulated at 1 ms."""
    model = mujoco.MjModel.from_xml_string(CART)
    model.opt.timestep = 0.001
    model.dof_frictionloss[0] = friction
    model.actuator_gainprm[0, 0] *= gain
    rng, lines = np.random.default_rng(3), ["time,push_cmd,rail,pivot,trial"]
    for trial in range(trials):
        data, goal = mujoco.MjData(model), 0.0
        for sample in range(round(seconds * RATE)):
            if sample % 20 == 10:
                goal = np.round(rng.uniform(-0.5, 0.5), 3)
            seen = data.qpos + rng.normal(0, NOISE, 2)
            cells = (sample / RATE, goal, *seen, trial)
            lines.append(",".join(f"{cell:.7g}" for cell in cells))
            data.ctrl[0] = goal
            mujoco.mj_step(model, data, 1000 // RATE)
    path.write_text("\n".join(lines) + "\n")


@pytest.fixture
def said(tmp_path):
    def run(friction):
        recorded(tmp_path / "log.csv", friction)
        _, model = described(tmp_path, CART, tmp_path / "log.csv")
        trials = model.read_log(str(tmp_path / "log.csv"))
        return trials, diagnose(trials, model, full=False), model

    return run


def test_an_unstable_robot_without_an_effect_has_no_gap(said):
    trials, found, _ = said(0.0)
    spans = [trial.times[-1] for trial in trials]
    assert len(trials) > 5 and max(spans) < 2.0  # cut to what is foreseen
    assert found.verdict.kind == "no gap"


def test_friction_of_an_unstable_robot_is_named(said):
    _, found, _ = said(0.4)
    assert found.verdict.named[0] == ("joint_friction[rail]",)
    assert found.best.magnitudes[0] == pytest.approx(0.4, abs=0.02)


@pytest.fixture
def weak(tmp_path):
    """One long recording of a cart whose motor pushes four fifths; its model."""
    recorded(tmp_path / "log.csv", trials=1, seconds=12.0, gain=0.8)
    _, model = described(tmp_path, CART, tmp_path / "log.csv")
    model = OwnModel(replace(model.config, cut=3.0), threads=1)
    return model, model.read_log(str(tmp_path / "log.csv"))


def test_pieces_of_a_long_recording_are_no_longer_than_what_is_foreseen(weak, tmp_path):
    model, trials = weak
    (whole,) = log.read(str(tmp_path / "log.csv"), model.config)
    assert len(cuts.pieces(whole, model.config)) == 4 < len(trials)


def test_starts_are_those_of_the_motion_that_was_found(weak):
    """Fitted to the nominal motion, they make up for what a weak motor lacks."""
    model, trials = weak
    known = {"actuator_gain[push]": 0.8}
    model.rows(trials)
    same, begun = model.beside(trials, [known] * len(trials))
    assert same is model
    away = [_rest(model, some, known) for some in (trials, begun)]
    assert away[1] < 0.5 * away[0]
    again = model.beside(begun, [known] * len(trials))[1]
    assert all(one is other for one, other in zip(again, begun, strict=True))
    found = diagnose(trials, model, full=False)
    assert found.verdict.named == (("actuator_gain[push]",),)
    assert found.best.magnitudes[0] == pytest.approx(0.8, abs=0.02)


def _rest(model, trials, known):
    """Mean square of what a cart's place departs by at the end of each piece [m2]."""
    (paths,) = model.paths(trials, [[known] * len(trials)])
    ends = [(t.observed[-1] - p[-1])[0] for t, p in zip(trials, paths, strict=True)]
    return float(np.mean(np.square(ends)))


def test_recordings_without_a_change_keep_all_that_the_model_can(said):
    """A pole in pieces: its unsure starts count in a model put right, too."""
    trials, _, model = said(0.0)
    made = Corrected(model, {}, {})
    assert made.whole and made.begun(trials[1])
    own = {name for name, item in vars(Corrected).items() if callable(item)}
    whole = {n for n, item in vars(GapModel).items() if callable(item) and n[0] != "_"}
    assert whole - own == {"started"}  # made of others


def test_trials_that_begin_in_a_known_state_stay_as_they_are(said):
    trials, _, model = said(0.0)
    known = OwnModel(replace(model.config, recorded=False), threads=1)
    plain = [trial.replace(conditions={}) for trial in trials]
    assert cuts.refined(plain, known.config, known) == plain


def test_a_lean_model_moves_alike_and_holds_no_pictures():
    spec = mujoco.MjSpec.from_string(CART)
    whole, small = spec.compile(), prepared.lean(spec).compile()
    assert small.nmesh == small.ntex == small.nmat == 0 < whole.nmesh
    assert small.nbuffer < 0.1 * whole.nbuffer
    ends = []
    for model in (whole, small):
        data = mujoco.MjData(model)
        data.ctrl[:] = 0.3
        mujoco.mj_step(model, data, 100)
        ends.append(data.qpos.copy())
    assert np.array_equal(*ends)


def test_a_mesh_that_a_sensor_needs_stays():
    sensor = '<sensor><framepos objtype="geom" objname="shell"/></sensor></mujoco>'
    named = CART.replace('mesh="hull" mass', 'mesh="hull" name="shell" mass')
    spec = mujoco.MjSpec.from_string(named.replace("</mujoco>", sensor))
    assert prepared.lean(spec).compile().nmesh == 1


def test_a_model_that_weighs_by_its_geoms_alone_can_be_loaded(tmp_path):
    text = CART.replace("<option", '<compiler inertiafromgeom="true"/><option')
    recorded(tmp_path / "log.csv", trials=1)
    _, model = described(tmp_path, text, tmp_path / "log.csv")
    plain = model.physics.model.body("cart").mass[0]
    heavy = model.parse("body_mass:part=cart,added=0.3,dx=0,dy=0,dz=0")
    assert model.physics.compiled((heavy,)).model.body("cart").mass[0] == plain + 0.3


WRIST = """<mujoco><option timestep="0.002"/><worldbody><body name="wrist">
  <joint name="turn" axis="0 1 0"/><geom size="0.05" pos="0.1 0 0" mass="MASS"/>
  </body></worldbody><actuator><motor name="turn" joint="turn"/></actuator></mujoco>"""


@pytest.mark.parametrize(("mass", "implicit"), [(0.1, True), (10.0, False)])
def test_a_loop_stiffer_than_the_step_is_integrated_implicitly(
    tmp_path, mass, implicit
):
    text = WRIST.replace("MASS", str(mass))
    times = np.arange(0, 12, 0.01)
    rows = np.stack([times, 0.2 * np.sin(3 * times), 0.2 * np.sin(3 * times)], axis=1)
    head = "time,turn_goal,turn_pos"
    np.savetxt(tmp_path / "log.csv", rows, delimiter=",", header=head, comments="")
    _, model = described(tmp_path, text, tmp_path / "log.csv", kp=50, kd=5)
    fast = mujoco.mjtIntegrator.mjINT_IMPLICITFAST
    assert (model.physics.model.opt.integrator == fast) is implicit
    assert len(model.read_log(str(tmp_path / "log.csv"))) == 4  # not unstable
